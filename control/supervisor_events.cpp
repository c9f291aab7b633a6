// The events of one step, from levels and times.
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>

#include "control/supervisor.hpp"
#include "control/supervisor_table.hpp"

namespace cutforce::control {
namespace {

constexpr float kLargest = 3e38F;
constexpr std::uint32_t kParts = 8;  // of the window of missed ticks

}  // namespace

// Inlined, all of them: events() is the one call from step().
[[gnu::always_inline]] inline void Supervisor::note_ages(const Input& input) noexcept {
  const std::uint32_t elapsed = 1 + std::min(input.missed_ticks, kNever);
  const auto grow = [elapsed](std::uint32_t& age, bool renewed) {
    age = renewed ? 0 : std::min(age + elapsed, kNever);
  };
  grow(state_.link_age, input.machine_state_new);
  grow(state_.sample_age, input.sample_new);
  // What is not finite is no force.
  const bool force = input.force_new && input.force_n >= -kLargest && input.force_n <= kLargest;
  grow(state_.force_age, force);
  grow(state_.estimate_age, force || state_.state != SupervisorState::kControl);
  const bool limited = input.force_limit_n > 0.0F;
  if (!limited) state_.forces_over = 0;
  if (!force) return;
  state_.force_n = input.force_n;
  if (!limited) return;
  const bool over = input.force_n > input.force_limit_n;
  state_.forces_over = (state_.forces_over << 1U | (over ? 1U : 0U)) & 7U;
}

// The window slides by eighths.
[[gnu::noinline]] void Supervisor::slide_window(std::uint32_t missed_ticks) noexcept {
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
  sum_missed();
}

void Supervisor::sum_missed() noexcept {
  std::uint32_t missed = 0;
  for (const std::uint32_t part : state_.missed) missed += part;
  missed_too_many_ = static_cast<float>(missed) > missed_most_;
}

// Whether too many ticks were missed, in a row or in the window.
[[gnu::always_inline]] inline bool Supervisor::note_missed(std::uint32_t missed_ticks) noexcept {
  if (missed_ticks == 0 && state_.window_steps + 1 < window_part_steps_) [[likely]] {
    state_.missed_run = 0;
    ++state_.window_steps;
    return missed_too_many_;
  }
  slide_window(missed_ticks);
  return state_.missed_run >= 3 || missed_too_many_;
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

[[gnu::always_inline]] inline EventSet Supervisor::faults(const Input& input) const noexcept {
  const std::uint32_t over = state_.forces_over;  // more than one bit of it
  const bool late = state_.link_age > link_steps_;
  const bool down = config_.link_required && input.bus_down;
  return when(input.stop, kStop) | when(input.output_failed, kOutputFailed) |
         when(input.foreign, kForeignNode) | when((over & (over - 1U)) != 0, kForceOver) |
         when(state_.controlled != 0, kControlled) |
         when(state_.sample_age > samples_steps_, kSamplesGone) |
         when(input.signals_refused, kSignalsRefused) |
         when(state_.estimate_age > estimate_steps_, kEstimateGone) | when(down, kBusIsDown) |
         when(late, kLinkLate) | when(!late && !down, kLinkOk);
}

// Beyond kReady nobody asks for them.
[[gnu::always_inline]] inline EventSet Supervisor::tests(const Input& input) const noexcept {
  if (state_.state > SupervisorState::kReady) [[likely]]
    return kAlways;
  return when(input.self_test_done && !input.self_test_passed, kSelfTestFails) |
         when(input.self_test_done && input.self_test_passed, kSelfTestPasses) |
         when(input.checks_done && !input.checks_passed, kChecksFail) |
         when(input.checks_done && input.checks_passed, kChecksPass);
}

[[gnu::always_inline]] inline EventSet Supervisor::holds(const Input& input,
                                                         bool overran) const noexcept {
  return when(input.inhibit, kInhibit) | when(input.threading || input.reversed, kThreads) |
         when(!input.spindle_at_speed, kSpindleOff) | when(overran, kOverran) |
         when(state_.sample_age > samples_steps_ / 2, kSamplesLate);
}

[[gnu::always_inline]] inline EventSet Supervisor::requests(const Input& input) const noexcept {
  static_assert(kControlLow == 2 * kArmLow && kArmEdge == kArmLow * 4 &&
                kControlEdge == 2 * kArmEdge && kResetEdge == 4 * kArmEdge);
  const std::uint32_t high = buttons(input);
  const std::uint32_t edges = high & state_.lows & edges_allowed_;
  EventSet events = (~high & (kArmBit | kControlBit)) * kArmLow | edges * kArmEdge;
  if ((edges & kResetBit) != 0) [[unlikely]]
    events |= when(protect_clear(input), kProtectClear) | when(safe_clear(input), kSafeClear);
  return events;
}

// Armed, in control and at speed, no fault, nothing that holds, no button that was low before, and
// nothing late: what a board in a cut finds in each step. All of it in four words.
[[gnu::always_inline]] inline bool Supervisor::in_order(const Input& input,
                                                        bool overran) const noexcept {
  static_assert(offsetof(Input, reversed) == offsetof(Input, output_failed) + 7 &&
                offsetof(Input, spindle_at_speed) == offsetof(Input, arm) + 3);
  const auto* const bytes = reinterpret_cast<const unsigned char*>(&input);
  std::uint64_t faults = 0;
  std::uint32_t levels = 0;
  std::memcpy(&faults, bytes + offsetof(Input, output_failed), sizeof faults);
  std::memcpy(&levels, bytes + offsetof(Input, arm), sizeof levels);
  constexpr auto kWell = std::bit_cast<std::uint32_t>(
      std::array{true, true, false, true});  // arm, control, reset, spindle_at_speed
  return faults == 0 && levels == kWell && !overran && state_.state > SupervisorState::kReady &&
         state_.lows == kResetBit && state_.forces_over == 0 &&
         state_.sample_age <= samples_steps_ / 2 && state_.link_age <= link_steps_ &&
         state_.estimate_age <= estimate_steps_;
}

auto Supervisor::events(const Input& input) noexcept -> EventSet {
  note_ages(input);
  const bool overran = note_missed(input.missed_ticks);
  if (in_order(input, overran)) [[likely]] {
    state_.calm_steps = std::min(state_.calm_steps + 1, kNever);
    return kLinkOk | when(state_.controlled != 0, kControlled) |
           when(state_.calm_steps >= release_steps_, kCalm);
  }
  return all_events(input, overran);
}

auto Supervisor::all_events(const Input& input, bool overran) noexcept -> EventSet {
  const EventSet causes = holds(input, overran);
  state_.calm_steps = causes == 0 ? std::min(state_.calm_steps + 1, kNever) : 0;
  return faults(input) | tests(input) | causes | requests(input) |
         when(state_.calm_steps >= release_steps_, kCalm);
}

}  // namespace cutforce::control
