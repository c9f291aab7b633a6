#include "control/supervisor.hpp"

#include <algorithm>

#include "control/supervisor_table.hpp"

namespace cutforce::control {
namespace {

using S = SupervisorState;

[[nodiscard]] constexpr bool is_in(S state, StateSet states) noexcept {
  return (states & only(state)) != 0;
}
constexpr StateSet kLatched = from_to(S::kLinkLost, S::kDead);

// Rounded; 0..254.
[[nodiscard]] constexpr std::uint8_t byte(float percent) noexcept {
  return static_cast<std::uint8_t>(percent + 0.5F);
}

}  // namespace

// The fall of a latched state, from its beginning.
void Supervisor::enter(SupervisorState before, bool force_over) noexcept {
  const S now = state_.state;
  if (before == S::kProtect) state_.forces_over = 0;
  if (!is_in(now, kLatched)) {
    state_.controlled = is_in(now, detail::kInControl) ? 1 : 0;
    return;
  }
  const bool moved = state_.controlled != 0;
  if (!is_in(before, kLatched)) {
    state_.position_pct = std::min(static_cast<float>(state_.override_pct), config_.neutral_pct);
    state_.fall_to_pct =
        moved ? std::min(state_.position_pct, config_.fallback_pct) : state_.position_pct;
  } else {
    state_.position_pct =
        std::max(state_.position_pct - config_.fall_pct_s * config_.period_s, state_.fall_to_pct);
  }
  if (now == S::kProtect || (now == S::kSafe && force_over && moved)) {
    state_.fall_to_pct = std::min(state_.fall_to_pct, config_.hold_pct);
    state_.position_pct = state_.fall_to_pct;
  }
  if (now == S::kDead) state_.position_pct = state_.fall_to_pct;
}

// In kHold by these the controller is off: what it would see is not the force of a cut.
bool Supervisor::controller_off() const noexcept {
  return state_.reason == Reason::kInhibited || state_.reason == Reason::kThreading;
}

std::uint8_t Supervisor::following(std::uint8_t controller_pct) const noexcept {
  const std::uint8_t last_pct = state_.override_pct;
  const std::uint8_t neutral_pct = byte(config_.neutral_pct);
  const std::uint8_t wanted_pct = std::min<std::uint8_t>(controller_pct, 254);
  switch (state_.state) {
    case S::kBoot:
    case S::kSelfTest:
    case S::kCheck:
      return last_pct;
    case S::kReady:
    case S::kMonitor:
      return std::min(wanted_pct, std::max(last_pct, neutral_pct));
    case S::kControl:
      return wanted_pct;
    case S::kHold:
      return std::min(last_pct, controller_off() ? neutral_pct : wanted_pct);
    case S::kLinkLost:
    case S::kProtect:
    case S::kSafe:
    case S::kDead:
      break;
  }
  return byte(state_.position_pct);
}

Permission Supervisor::permission() const noexcept {
  const bool hold = state_.state == S::kHold;
  const bool idle = is_in(state_.state, from_to(S::kReady, S::kMonitor));
  const bool control = state_.state == S::kControl;
  Permission permission = kEverything;
  permission.enable = control || (hold && !controller_off());
  permission.may_rise = control || idle;
  if (hold || is_in(state_.state, kLatched))
    permission.ceiling_pct = static_cast<float>(state_.override_pct);
  return permission;
}

auto Supervisor::step(const Input& input) noexcept -> Output {
  note_ages(input);
  note_force(input);
  note_missed(input.missed_ticks);
  const EventSet causes = holds(input);
  state_.calm_steps = causes == 0 ? std::min(state_.calm_steps + 1, kNever) : 0;
  const EventSet events =
      faults(input) | causes | requests(input) | when(state_.calm_steps >= release_steps_, kCalm);

  const S before = state_.state;
  const Reason reason = state_.reason;
  if (const Transition* row = transition(before, events); row != nullptr) {
    state_.state = row->next;
    state_.reason = row->reason;
  }
  enter(before, (events & kForceOver) != 0);
  const bool moved = state_.state != before;
  const std::uint8_t last_pct = state_.override_pct;
  const std::uint8_t wanted_pct = following(input.override_pct);
  state_.override_pct = moved ? std::min(wanted_pct, last_pct) : wanted_pct;

  const bool arm_low = !input.arm && (before != S::kLinkLost || (events & kLinkOk) != 0);
  const std::uint32_t lows =
      when(arm_low, kArmBit) | when(!input.control, kControlBit) | when(!input.reset, kResetBit);
  state_.lows = static_cast<std::uint8_t>(moved ? 0 : lows);

  const S now = state_.state;
  const bool starting = now == S::kBoot || now == S::kSelfTest;
  return {
      .state = now,
      .reason = state_.reason,
      .override_pct = state_.override_pct,
      .controlling = is_in(now, detail::kInControl),
      .alive = is_in(now, detail::kOnTheLines),
      .alarm = is_in(now, kLatched) || (now == S::kMonitor && state_.reason == Reason::kForceLimit),
      .silent = starting || now == S::kDead || input.bus_down,
      .permission = permission(),
      .changed = moved || state_.reason != reason};
}

}  // namespace cutforce::control
