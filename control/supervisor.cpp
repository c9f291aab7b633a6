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

// By value: std::min takes addresses, and what is smaller than a register goes over the stack.
[[nodiscard]] constexpr std::uint32_t lesser(std::uint32_t a, std::uint32_t b) noexcept {
  return a < b ? a : b;
}

// Rounded; 0..254.
[[nodiscard]] constexpr std::uint8_t byte(float percent) noexcept {
  return static_cast<std::uint8_t>(percent + 0.5F);
}

}  // namespace

auto Supervisor::make(const Config& config) noexcept -> std::expected<Supervisor, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return Supervisor{config};
}

Supervisor::Supervisor(const Config& config) noexcept
    : config_(config),
      link_steps_(config.link_required ? steps(config.link_timeout_s) : kNever),
      samples_steps_(steps(config.samples_timeout_s)),
      estimate_steps_(steps(config.estimate_timeout_s)),
      release_steps_(steps(config.hold_release_s)),
      window_part_steps_(std::max<std::uint32_t>(steps(config.overrun_window_s) / 8, 1U)),
      missed_most_(config.overrun_ratio * static_cast<float>(steps(config.overrun_window_s))),
      edges_allowed_(config.mode == SupervisorMode::kControl ? kArmBit | kControlBit | kResetBit
                                                             : kArmBit | kResetBit),
      neutral_pct_(byte(config.neutral_pct)) {
  state_ = {.state = S::kBoot,
            .reason = Reason::kNone,
            .override_pct = byte(config.neutral_pct),
            .lows = 0,
            .controlled = 0,
            .forces_over = 0,
            .force_n = 0.0F,
            .position_pct = config.neutral_pct,
            .fall_to_pct = config.neutral_pct,
            .link_age = kNever,
            .sample_age = kNever,
            .force_age = kNever,
            .estimate_age = 0,
            .calm_steps = 0,
            .missed_run = 0,
            .window_steps = 0,
            .window_part = 0,
            .missed = {}};
}

std::uint32_t Supervisor::steps(float time_s) const noexcept {
  return std::max<std::uint32_t>(static_cast<std::uint32_t>(time_s / config_.period_s + 0.5F), 1U);
}

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

[[gnu::always_inline]] inline Permission Supervisor::permission() const noexcept {
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
  const EventSet events = this->events(input);
  const S before = state_.state;
  const Reason reason = state_.reason;
  const Transition* const row = transition(before, events);
  if (row != nullptr) [[unlikely]] {
    state_.state = row->next;
    state_.reason = row->reason;
  }
  if (row != nullptr || is_in(before, kLatched)) enter(before, (events & kForceOver) != 0);
  const bool moved = state_.state != before;
  const std::uint32_t wanted_pct = following(input.override_pct);
  state_.override_pct =
      static_cast<std::uint8_t>(moved ? lesser(wanted_pct, state_.override_pct) : wanted_pct);

  std::uint32_t lows = ~buttons(input) & (kArmBit | kControlBit | kResetBit);
  if (before == S::kLinkLost && (events & kLinkOk) == 0) lows &= ~kArmBit;
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
