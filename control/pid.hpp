// PID law with fixed gains and a filtered derivative, (C40)-(C44): P2 5.1.
//
//   E(i) = F_r - F(i)
//   D(i) = r D(i-1) - K_d (F(i) - F(i-1)),  r = T_f / (T_f + T),  K_d = K_P T_D / (T_f + T)
//   U(i) = U_b(i-1) + K_P (E(i) - E(i-1)) + K_P (T / T_I) E(i) + D(i) - D(i-1)
//
// E [N], U and D [%], K_P [%/N], T_I and T_D [s], T_f = T_D / N, T the period. U_b is the wanted
// override moved to within the rounding of the one that acted (C2): as with the PI law it is the
// whole anti-windup, and taking over is free of jumps. The derivative is the force's, not the
// error's: a new reference does not kick. T_D = 0 is a PI law.
//
// P2 prints gains for an unfiltered derivative (N very large) at T = 20 ms; with them no loop on
// its plant is stable (host_tests/pid_test.cpp). Ziegler and Nichols' rules are below.
#pragma once

#include <algorithm>
#include <cstdint>
#include <expected>

#include "control/law.hpp"

namespace cutforce::control {

class Pid {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kGain, kIntegral, kDerivative, kFilter };

  struct Config {
    float period_s;
    float proportional_pct_n;
    float integral_time_s;          // in which a standing error adds its proportional part again
    float derivative_time_s;        // 0: none
    float derivative_filter_ratio;  // N, 1 to 1e6; 10 advised, 1e6 is no filter

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s > 0.0F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(proportional_pct_n > 0.0F && proportional_pct_n <= kGainLimit))
        return std::unexpected{ConfigError::kGain};
      if (!(integral_time_s >= 0.01F * period_s && integral_time_s <= 1e6F * period_s))
        return std::unexpected{ConfigError::kIntegral};
      if (!(derivative_time_s >= 0.0F && derivative_time_s <= 1e4F * period_s))
        return std::unexpected{ConfigError::kDerivative};
      if (!(derivative_filter_ratio >= 1.0F && derivative_filter_ratio <= 1e6F))
        return std::unexpected{ConfigError::kFilter};
      return {};
    }
  };

  using Input = LawInput;
  using Output = LawOutput;

  struct State {
    float wanted_pct = 100.0F;    // U(i-1)
    float error_n = 0.0F;         // E(i-1)
    float force_n = 0.0F;         // F(i-1)
    float derivative_pct = 0.0F;  // D(i-1)
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<Pid, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return Pid{config};
  }

  [[nodiscard]] constexpr Output step(const Input& input) noexcept {
    const float error_n = input.force_reference_n - input.force_n;  // (C1)
    const float base_pct =
        std::clamp(state_.wanted_pct, input.override_applied_pct - input.override_tolerance_pct,
                   input.override_applied_pct + input.override_tolerance_pct);  // (C2)
    const State before = state_;
    // Holding, the force is an old one: error and derivative stay with the override they made.
    if (input.mode != LawMode::kHold) {
      state_.error_n = error_n;
      state_.force_n = input.force_n;
    }
    if (input.mode != LawMode::kActive) {
      state_.wanted_pct = base_pct;
      // Another's override has no derivative part in it that would have to fade.
      if (input.mode == LawMode::kTrack) state_.derivative_pct = 0.0F;
      return law_answer(input.override_applied_pct);
    }
    state_.derivative_pct = std::clamp(filter_ratio_ * before.derivative_pct -
                                           derivative_pct_n_ * (input.force_n - before.force_n),
                                       -kFarPct, kFarPct);  // (C40)
    const float wanted_pct = base_pct + proportional_pct_n_ * (error_n - before.error_n) +
                             integral_pct_n_ * error_n +
                             (state_.derivative_pct - before.derivative_pct);  // (C41)
    state_.wanted_pct = std::clamp(wanted_pct, -kFarPct, kFarPct);
    return law_answer(state_.wanted_pct);
  }

  // In charge after another law: as make() left it.
  constexpr void rejoin() noexcept { state_ = State{}; }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kGainLimit = 1e4F;
  static constexpr float kFarPct = 1e4F;  // far beyond every limit, and finite

  explicit constexpr Pid(const Config& config) noexcept
      : proportional_pct_n_(config.proportional_pct_n),
        integral_pct_n_(config.proportional_pct_n * config.period_s / config.integral_time_s) {
    const float filter_s = config.derivative_time_s / config.derivative_filter_ratio;
    filter_ratio_ = filter_s / (filter_s + config.period_s);
    derivative_pct_n_ =
        config.proportional_pct_n * config.derivative_time_s / (filter_s + config.period_s);
  }

  float proportional_pct_n_;
  float integral_pct_n_;
  float filter_ratio_ = 0.0F;
  float derivative_pct_n_ = 0.0F;
  State state_{};
};

static_assert(Law<Pid>);
static_assert(sizeof(Pid::State) == 4 * 4);

// What Ziegler and Nichols' rules make of the gain and the period at which a proportional law
// rings; P2 5.1 (PID), P3 4.1 (PI). They aim at a quarter of the overshoot from swing to swing, and
// so leave little margin.
struct ZieglerNichols {
  float proportional_pct_n;
  float integral_time_s;
  float derivative_time_s;
};

[[nodiscard]] constexpr ZieglerNichols ziegler_nichols_pid(float ultimate_gain_pct_n,
                                                           float ultimate_period_s) noexcept {
  return {.proportional_pct_n = 0.6F * ultimate_gain_pct_n,  // (C43)
          .integral_time_s = 0.5F * ultimate_period_s,
          .derivative_time_s = 0.125F * ultimate_period_s};
}

[[nodiscard]] constexpr ZieglerNichols ziegler_nichols_pi(float ultimate_gain_pct_n,
                                                          float ultimate_period_s) noexcept {
  return {.proportional_pct_n = 0.45F * ultimate_gain_pct_n,  // (C44)
          .integral_time_s = ultimate_period_s / 1.2F,
          .derivative_time_s = 0.0F};
}

}  // namespace cutforce::control
