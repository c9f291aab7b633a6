// PI law with fixed gains, (C1)-(C4): P1 (4), P3 4.1.
//
//   E(i) = F_r - F(i)
//   velocity form   U(i) = U_b(i-1) + (Kp + Ki T) E(i) - Kp E(i-1)
//   position form   U(i) = Kp E(i) + I(i),
//                   I(i) = I(i-1) + Ki T E(i) + (T / T_t) (U_b(i-1) - U(i-1))
//   U_b(i-1) = U(i-1) moved to within the rounding of the override that really acted
//
// E [N], U and I [%], Kp [%/N], Ki [%/(N s)], T the period, T_t the tracking time. U_b is the whole
// anti-windup: what a limit, a slew rate, an air cut or the CNC took away is not remembered, what
// mere rounding took away is, else every increment below half a step would be lost and the loop
// would rest at a wrong force. With T_t = T both forms are the same law.
//
// Supervised, both gains are lowered together while the process gain that is seen leaves them less
// than the margin of gain_supervision.hpp, and the law publishes what it saw.
#pragma once

#include <algorithm>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "control/gain_supervision.hpp"
#include "control/law.hpp"
#include "control/velocity_form.hpp"

namespace cutforce::control {

class PiController {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kForm, kGain, kTracking };
  enum class Form : std::uint8_t { kVelocity, kPosition };

  struct Config {
    float period_s;
    Form form;
    float proportional_pct_n;
    float integral_pct_n_s;
    float tracking_s;  // position form: time in which the integral gives way, at least the period
    bool supervise;    // lower the gains where the process would make them unstable

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s > 0.0F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (form != Form::kVelocity && form != Form::kPosition)
        return std::unexpected{ConfigError::kForm};
      if (!(proportional_pct_n >= 0.0F && proportional_pct_n <= kGainLimit))
        return std::unexpected{ConfigError::kGain};
      if (!(integral_pct_n_s > 0.0F && integral_pct_n_s <= kGainLimit))
        return std::unexpected{ConfigError::kGain};
      if (!(tracking_s >= period_s && tracking_s <= 1e4F * period_s))
        return std::unexpected{ConfigError::kTracking};
      return {};
    }

    // Largest process gain k [N/%] at which the loop is stable on the plant F(i) = k U(i-1), the
    // cut that settles within one tick: k Kp < 1 and k (2 Kp + Ki T) < 2, (C13).
    [[nodiscard]] constexpr float highest_process_gain_n_pct() const noexcept {
      const float alternating = 2.0F / (2.0F * proportional_pct_n + integral_pct_n_s * period_s);
      return proportional_pct_n > 0.0F ? std::min(alternating, 1.0F / proportional_pct_n)
                                       : alternating;
    }
  };

  using Input = LawInput;
  using Output = LawOutput;

  struct State {
    float wanted_pct = 100.0F;  // U(i-1)
    float error_n = 0.0F;       // E(i-1)
    GainSupervision supervision{};
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<PiController, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return PiController{config};
  }

  [[nodiscard]] [[gnu::always_inline]] constexpr Output step(const Input& input) noexcept {
    if (supervise_) [[unlikely]]
      return step_supervised(input);
    return law_answer(velocity_form_pct(state_, input, gains_));
  }

  // In charge after another law: as make() left it.
  constexpr void rejoin() noexcept { state_ = State{}; }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kGainLimit = 1e4F;

  explicit constexpr PiController(const Config& config) noexcept
      : gains_{.proportional_pct_n = config.proportional_pct_n,
               .integral_pct_n = config.integral_pct_n_s * config.period_s,
               // The velocity form is the position form that gives way at once.
               .tracking_ratio =
                   config.form == Form::kVelocity ? 1.0F : config.period_s / config.tracking_s},
        highest_process_gain_n_pct_(config.highest_process_gain_n_pct()),
        supervise_(config.supervise) {}

  [[gnu::always_inline]] constexpr Output step_supervised(const Input& input) noexcept {
    GainSupervision& seen = state_.supervision;
    seen.observe(input);
    const float scale = seen.scale_ratio(highest_process_gain_n_pct_);
    const float override_pct =
        velocity_form_pct(state_, input,
                          {.proportional_pct_n = scale * gains_.proportional_pct_n,
                           .integral_pct_n = scale * gains_.integral_pct_n,
                           .tracking_ratio = gains_.tracking_ratio});
    return {.override_pct = override_pct,
            .process_gain_n_pct = seen.highest_n_pct(),
            .process_gain_sigma_ratio = seen.sigma_ratio(),
            .stability_margin_ratio = seen.margin_ratio(highest_process_gain_n_pct_)};
  }

  VelocityGains gains_;
  float highest_process_gain_n_pct_;
  bool supervise_;
  State state_{};
};

static_assert(Law<PiController>);
static_assert(sizeof(PiController::State) == 7 * 4);

}  // namespace cutforce::control
