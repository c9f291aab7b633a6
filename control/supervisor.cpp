#include "control/supervisor.hpp"

#include <algorithm>
#include <array>

#include "control/supervisor_table.hpp"

namespace cutforce::control {
namespace {

using S = SupervisorState;

[[nodiscard]] constexpr bool is_in(S state, StateSet states) noexcept {
  return (states & only(state)) != 0;
}
constexpr StateSet kLatched = from_to(S::kLinkLost, S::kDead);

// By state; a hold by its cause, the monitor and the bus have their say in Supervisor::outward().
constexpr auto kOutward = [] {
  std::array<Supervisor::Outward, kSupervisorStateCount> all{};
  for (unsigned k = 0; k < all.size(); ++k) {
    const auto state = static_cast<S>(k);
    all[k] = {.controlling = is_in(state, detail::kInControl),
              .alive = is_in(state, detail::kOnTheLines),
              .alarm = is_in(state, kLatched),
              .silent = is_in(state, only(S::kBoot) | only(S::kSelfTest) | only(S::kDead)),
              .permission = kEverything};
    all[k].permission.enable = is_in(state, detail::kInControl);
    all[k].permission.may_rise = is_in(state, from_to(S::kReady, S::kControl));
  }
  return all;
}();
static_assert(from_to(S::kHold, S::kDead) == (only(S::kHold) | kLatched));

// By value: std::min takes addresses, and what is smaller than a register goes over the stack.
[[nodiscard]] constexpr std::uint32_t lesser(std::uint32_t a, std::uint32_t b) noexcept {
  return a < b ? a : b;
}

// Rounded; 0..254.
[[nodiscard]] constexpr std::uint8_t byte(float percent) noexcept {
  return static_cast<std::uint8_t>(percent + 0.5F);
}

}  // namespace

// The fall of a latched state, from its beginning.
[[gnu::always_inline]] inline void Supervisor::enter(SupervisorState before,
                                                     bool force_over) noexcept {
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
[[gnu::always_inline]] inline bool Supervisor::controller_off() const noexcept {
  return state_.reason == Reason::kInhibited || state_.reason == Reason::kThreading;
}

[[gnu::always_inline]] inline std::uint32_t Supervisor::following(
    std::uint32_t controller_pct) const noexcept {
  const std::uint32_t last_pct = state_.override_pct;
  const std::uint32_t neutral_pct = neutral_pct_;
  const std::uint32_t wanted_pct = lesser(controller_pct, 254);
  switch (state_.state) {
    case S::kBoot:
    case S::kSelfTest:
    case S::kCheck:
      return last_pct;
    case S::kReady:
    case S::kMonitor:
      return lesser(wanted_pct, last_pct > neutral_pct ? last_pct : neutral_pct);
    case S::kControl:
      return wanted_pct;
    case S::kHold:
      return lesser(last_pct, controller_off() ? neutral_pct : wanted_pct);
    case S::kLinkLost:
    case S::kProtect:
    case S::kSafe:
    case S::kDead:
      break;
  }
  return byte(state_.position_pct);
}

[[gnu::always_inline]] inline auto Supervisor::outward(bool bus_down) const noexcept -> Outward {
  const S now = state_.state;
  Outward outward = kOutward[static_cast<unsigned>(now)];
  if (now == S::kMonitor && state_.reason == Reason::kForceLimit) outward.alarm = true;
  if (bus_down) outward.silent = true;
  if (now >= S::kHold) {
    if (now == S::kHold && controller_off()) outward.permission.enable = false;
    outward.permission.ceiling_pct = static_cast<float>(state_.override_pct);
  }
  return outward;
}

auto Supervisor::step(const Input& input) noexcept -> Output {
  const EventSet events = this->events(input);
  const Transition* const row = transition(state_.state, events);
  if (row != nullptr || is_in(state_.state, kLatched)) [[unlikely]]
    return step_on(row, events, input);
  state_.override_pct = static_cast<std::uint8_t>(following(input.override_pct));
  state_.lows = static_cast<std::uint8_t>(~buttons(input) & kAllButtons);
  return {{outward(input.bus_down)}, state_.state, state_.reason, state_.override_pct, false};
}

// By a row of the table, or in a state whose override may fall.
auto Supervisor::step_on(const Transition* row, EventSet events, const Input& input) noexcept
    -> Output {
  const S before = state_.state;
  const Reason reason = state_.reason;
  if (row != nullptr) {
    state_.state = row->next;
    state_.reason = row->reason;
  }
  enter(before, (events & kForceOver) != 0);
  const bool moved = state_.state != before;
  const std::uint32_t wanted_pct = following(input.override_pct);
  state_.override_pct =
      static_cast<std::uint8_t>(moved ? lesser(wanted_pct, state_.override_pct) : wanted_pct);

  std::uint32_t lows = ~buttons(input) & kAllButtons;
  if (before == S::kLinkLost && (events & kLinkOk) == 0) lows &= ~kArmBit;
  state_.lows = static_cast<std::uint8_t>(moved ? 0 : lows);
  return {{outward(input.bus_down)},
          state_.state,
          state_.reason,
          state_.override_pct,
          moved || state_.reason != reason};
}

}  // namespace cutforce::control
