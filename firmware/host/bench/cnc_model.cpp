#include "firmware/host/bench/cnc_model.hpp"

#include <array>
#include <cstddef>

#include "control/supervisor.hpp"

namespace cutforce::firmware::host {
namespace {

using Board = control::SupervisorState;

bool is(const CncModel::Input& input, Board state) noexcept {
  return input.board_state && *input.board_state == static_cast<std::uint8_t>(state);
}

bool follows(const CncModel::Input& input) noexcept {
  return is(input, Board::kMonitor) || is(input, Board::kControl) || is(input, Board::kHold);
}

}  // namespace

auto CncModel::make(const Config& config) noexcept -> std::expected<CncModel, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return CncModel{config};
}

auto CncModel::step(const Input& input) noexcept -> Output {
  State& s = state_;
  watch(input);
  operate(input);
  if (s.cnc == CncState::kFollowing && input.now_ns % config_.scan_ns == 0) {
    s.override_pct = s.newest_pct;
  }
  // A lost link is acknowledged by the arm switch, everything else by the reset button.
  const bool button = input.now_ns < s.button_until_ns;
  const bool link_lost = is(input, Board::kLinkLost);
  return {.state = s.cnc,
          .override_pct = static_cast<std::uint8_t>(s.override_pct),
          .arm = s.arm || (button && link_lost),
          .control = s.control,
          .reset = button && !link_lost};
}

void CncModel::watch(const Input& input) noexcept {
  State& s = state_;
  s.told = s.told || input.board_state;
  if (input.is_new && input.override_pct) {
    s.heard_ns = input.now_ns;
    s.newest_pct = *input.override_pct;
    if (s.cnc == CncState::kWaiting) s.cnc = CncState::kFollowing;
  } else if (s.cnc == CncState::kFollowing && input.now_ns - s.heard_ns > config_.timeout_ns) {
    fall_back();
  }
}

void CncModel::fall_back() noexcept {
  State& s = state_;
  ++s.silences;
  const bool controlled = s.control || !s.told;
  s.spent = s.spent || s.arm;
  s.arm = s.control = s.armed = false;
  if (!controlled || config_.on_silence == OnSilence::kProgrammed) {
    s.cnc = controlled ? CncState::kFull : CncState::kProgrammed;
    s.override_pct = 100;
  } else if (config_.on_silence == OnSilence::kHold) {
    s.cnc = CncState::kFeedHold;
    s.override_pct = 0;
  } else {
    s.cnc = CncState::kKept;
  }
}

void CncModel::operate(const Input& input) noexcept {
  State& s = state_;
  const bool faulty =
      is(input, Board::kLinkLost) || is(input, Board::kProtect) || is(input, Board::kSafe);
  // Armed, and the board went back by itself: down with the switches, so that they can rise again.
  if (s.armed && !follows(input)) {
    s.arm = s.control = s.armed = false;
    s.spent = true;
  }
  const bool speaks = input.now_ns - s.heard_ns <= config_.timeout_ns;
  acknowledge(input, (is_silent(s.cnc) || faulty) && speaks);
  if (s.cnc == CncState::kFollowing && input.now_ns >= s.rest_until_ns) arm(input);
}

void CncModel::acknowledge(const Input& input, bool fault) noexcept {
  State& s = state_;
  if (!fault || !config_.rearm || input.now_ns < s.rest_until_ns) {
    s.fault_ns = -1;
    return;
  }
  if (s.fault_ns < 0) s.fault_ns = input.now_ns;
  if (input.now_ns - s.fault_ns < kOperator_ns) return;
  s.fault_ns = -1;
  s.button_until_ns = input.now_ns + kButton_ns;
  s.rest_until_ns = s.button_until_ns + kButton_ns;
  s.cnc = CncState::kFollowing;
}

void CncModel::arm(const Input& input) noexcept {
  State& s = state_;
  if (!config_.arm || (s.spent && !config_.rearm)) return;
  if (!s.arm) {
    if (input.now_ns < config_.arm_ns || !is(input, Board::kReady)) return;
    s.arm = true;
    ++s.armings;
    return;
  }
  s.armed = s.armed || follows(input);
  give_control(input);
}

// A board that does not take control was not fit for it at the edge: another edge, a little later.
void CncModel::give_control(const Input& input) noexcept {
  State& s = state_;
  if (!config_.control || !is(input, Board::kMonitor) || input.now_ns < config_.control_ns) return;
  if (input.now_ns - s.control_ns < kAgain_ns && s.control_ns > 0) return;
  if (!s.control && !input.spindle_at_speed) return;
  s.control = !s.control;
  s.control_ns = input.now_ns;
}

std::string_view cnc_text(CncState state) noexcept {
  constexpr std::array<std::string_view, 6> kTexts{
      "feed as programmed, the board has not been heard",
      "follows the board",
      "feed as programmed, the board is silent",
      "FEED HOLD, the board is silent",
      "override kept as it was, the board is silent",
      "feed as programmed (asked for), the board is silent in control"};
  return kTexts[static_cast<std::size_t>(state)];
}

std::string_view cnc_name(CncState state) noexcept {
  constexpr std::array<std::string_view, 6> kNames{"waiting",   "following", "programmed",
                                                   "feed_hold", "kept",      "full"};
  return kNames[static_cast<std::size_t>(state)];
}

}  // namespace cutforce::firmware::host
