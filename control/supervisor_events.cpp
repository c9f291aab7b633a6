// The events of one step, from levels and times.
#include <algorithm>

#include "control/supervisor.hpp"
#include "control/supervisor_table.hpp"

namespace cutforce::control {
namespace {

constexpr float kLargest = 3e38F;
constexpr std::uint32_t kParts = 8;  // of the window of missed ticks

}  // namespace

void Supervisor::note_ages(const Input& input) noexcept {
  const std::uint32_t elapsed = 1 + std::min(input.missed_ticks, kNever);
  const auto grow = [elapsed](std::uint32_t& age, bool renewed) {
    age = renewed ? 0 : std::min(age + elapsed, kNever);
  };
  grow(state_.link_age, input.machine_state_new);
  grow(state_.sample_age, input.sample_new);
  grow(state_.force_age, false);
  grow(state_.estimate_age, state_.state != SupervisorState::kControl);
}

// What is not finite is no force.
void Supervisor::note_force(const Input& input) noexcept {
  const bool limited = input.force_limit_n > 0.0F;
  if (!limited) state_.forces_over = 0;
  if (!input.force_new || !(input.force_n >= -kLargest && input.force_n <= kLargest)) return;
  state_.force_n = input.force_n;
  state_.force_age = 0;
  state_.estimate_age = 0;
  const bool over = limited && input.force_n > input.force_limit_n;
  state_.forces_over = (state_.forces_over << 1U | (over ? 1U : 0U)) & 7U;
}

// The window slides by eighths.
void Supervisor::note_missed(std::uint32_t missed_ticks) noexcept {
  const std::uint32_t missed = std::min(missed_ticks, kNever / 8);
  state_.missed_run = missed == 0 ? 0 : std::min(state_.missed_run + missed, kNever);
  state_.window_steps = std::min(state_.window_steps + 1 + missed, kNever);
  for (std::uint32_t k = 0; k < kParts && state_.window_steps >= window_part_steps_; ++k) {
    state_.window_steps -= window_part_steps_;
    state_.window_part = (state_.window_part + 1) % kParts;
    state_.missed[state_.window_part] = 0;
  }
  state_.window_steps = std::min(state_.window_steps, window_part_steps_);
  std::uint32_t& newest = state_.missed[state_.window_part];
  newest = std::min(newest + missed, kNever / 8);
}

bool Supervisor::overran() const noexcept {
  std::uint32_t missed = 0;
  for (const std::uint32_t part : state_.missed) missed += part;
  return state_.missed_run >= 3 || static_cast<float>(missed) > missed_most_;
}

// At rest a spindle has no estimate: then nobody can wait for one.
bool Supervisor::protect_clear(const Input& input) const noexcept {
  const bool low = state_.force_n < 0.5F * input.force_limit_n;
  return !input.feeding &&
         (low || !(input.force_limit_n > 0.0F) || state_.force_age > estimate_steps_);
}

bool Supervisor::safe_clear(const Input& input) const noexcept {
  const Reason reason = state_.reason;
  if (input.output_failed || input.foreign || input.arm) return false;
  if (reason == Reason::kSignalFault) return !input.signals_refused;
  if (reason == Reason::kSamplesMissing || reason == Reason::kEstimateLost)
    return state_.sample_age <= samples_steps_ / 2;
  return true;
}

std::uint32_t Supervisor::faults(const Input& input) const noexcept {
  const bool linked = config_.link_required;
  const std::uint32_t over = state_.forces_over;  // more than one bit of it
  const bool late = linked && state_.link_age > link_steps_;
  const bool down = linked && input.bus_down;
  return when(input.stop, kStop) | when(input.output_failed, kOutputFailed) |
         when(input.foreign, kForeignNode) | when((over & (over - 1U)) != 0, kForceOver) |
         when(state_.controlled != 0, kControlled) |
         when(state_.sample_age > samples_steps_, kSamplesGone) |
         when(input.signals_refused, kSignalsRefused) |
         when(state_.estimate_age > estimate_steps_, kEstimateGone) | when(down, kBusIsDown) |
         when(late, kLinkLate) | when(!late && !down, kLinkOk) |
         when(input.self_test_done && !input.self_test_passed, kSelfTestFails) |
         when(input.self_test_done && input.self_test_passed, kSelfTestPasses) |
         when(input.checks_done && !input.checks_passed, kChecksFail) |
         when(input.checks_done && input.checks_passed, kChecksPass);
}

std::uint32_t Supervisor::holds(const Input& input) const noexcept {
  return when(input.inhibit, kInhibit) | when(input.threading || input.reversed, kThreads) |
         when(!input.spindle_at_speed, kSpindleOff) | when(overran(), kOverran) |
         when(state_.sample_age > samples_steps_ / 2, kSamplesLate);
}

std::uint32_t Supervisor::requests(const Input& input) const noexcept {
  const std::uint32_t lows = state_.lows;
  const bool control = input.control && config_.mode == SupervisorMode::kControl;
  return when(!input.arm, kArmLow) | when(!input.control, kControlLow) |
         when(input.arm && (lows & kArmBit) != 0, kArmEdge) |
         when(control && (lows & kControlBit) != 0, kControlEdge) |
         when(input.reset && (lows & kResetBit) != 0, kResetEdge) |
         when(protect_clear(input), kProtectClear) | when(safe_clear(input), kSafeClear);
}

}  // namespace cutforce::control
