// Model reference adaptive law: P2 5.2 as printed, the same normalised, or the usable form on the
// force alone. The equations are with the two forms (mrac_state_error.hpp, mrac_output_error.hpp);
// here is what both need: percent instead of mm/s, the force's rate, following and (C2).
//
// The state of P2's law is not measured: x_1 is the force's difference quotient behind a low-pass,
// and so is the model's, (C48), that like is compared with like.
//
// While another decides nothing is learned, and one parameter is solved again from the override
// that acts. The same when a limit acts: it is never remembered.
#pragma once

#include <algorithm>
#include <cstdint>
#include <expected>

#include "control/law.hpp"
#include "control/mrac_output_error.hpp"
#include "control/mrac_state_error.hpp"
#include "estimator/polynomials.hpp"

namespace cutforce::control {

class Mrac {
 public:
  enum class ConfigError : std::uint8_t {
    kForm,
    kPeriods,  // the forms have other periods
    kFeed,
    kDerivative,
    kStateError,
    kOutputError,
  };
  enum class Form : std::uint8_t { kStateError, kOutputError };

  // Both forms are checked, so that changing from one to the other is one word.
  struct Config {
    float period_s;
    Form form;
    float feed_mm_s_pct;  // programmed feed / 100
    float derivative_hz;  // corner of the force's rate; 10
    StateErrorMrac::Config state_error;
    OutputErrorMrac::Config output_error;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (form != Form::kStateError && form != Form::kOutputError)
        return std::unexpected{ConfigError::kForm};
      if (!(same(period_s, state_error.period_s) && same(period_s, output_error.period_s)))
        return std::unexpected{ConfigError::kPeriods};
      if (!state_error.check()) return std::unexpected{ConfigError::kStateError};
      if (!output_error.check()) return std::unexpected{ConfigError::kOutputError};
      if (!(feed_mm_s_pct >= 1e-6F && feed_mm_s_pct <= 1e3F))
        return std::unexpected{ConfigError::kFeed};
      if (!(derivative_hz * period_s >= 1e-4F && derivative_hz * period_s <= 10.0F))
        return std::unexpected{ConfigError::kDerivative};
      return {};
    }

   private:
    [[nodiscard]] static constexpr bool same(float a, float b) noexcept { return a <= b && a >= b; }
  };

  using Input = LawInput;
  using Output = LawOutput;

  struct State {
    float wanted_pct = 100.0F;
    float force_n = 0.0F;
    float force_rate_n_s = 0.0F;
    float model_force_n = 0.0F;
    float model_force_rate_n_s = 0.0F;
    StateErrorMrac::State state_error{};
    OutputErrorMrac::State output_error{};
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<Mrac, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return Mrac{config};
  }

  [[nodiscard]] constexpr Output step(const Input& input) noexcept {
    const float base_pct =
        std::clamp(state_.wanted_pct, input.override_applied_pct - input.override_tolerance_pct,
                   input.override_applied_pct + input.override_tolerance_pct);  // (C2)
    const bool active = input.mode == LawMode::kActive;
    const float wanted_pct = form_ == Form::kStateError
                                 ? on_the_state(input, base_pct, base_pct - state_.wanted_pct)
                                 : on_the_output(input, base_pct, base_pct - state_.wanted_pct);
    state_.wanted_pct = active ? std::clamp(wanted_pct, -kFarPct, kFarPct) : base_pct;
    state_.state_error = state_error_.state();
    state_.output_error = output_error_.state();
    auto answer = law_answer(active ? state_.wanted_pct : input.override_applied_pct);
    if (form_ == Form::kOutputError) answer.process_gain_n_pct = output_error_.process_gain_n_pct();
    return answer;
  }

  // In charge after another law: as make() left it.
  constexpr void rejoin() noexcept { restore(State{}); }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept {
    state_ = state;
    state_error_.restore(state.state_error);
    output_error_.restore(state.output_error);
  }

 private:
  static constexpr float kFarPct = 1e4F;  // far beyond every limit, and finite

  // config has passed check(): both forms can be made.
  explicit constexpr Mrac(const Config& config) noexcept
      : form_(config.form),
        feed_mm_s_pct_(config.feed_mm_s_pct),
        period_s_(config.period_s),
        rate_ratio_(1.0F -
                    estimator::exp_bounded(-6.2831853F * config.derivative_hz * config.period_s)),
        state_error_(*StateErrorMrac::make(config.state_error)),
        output_error_(*OutputErrorMrac::make(config.output_error)) {}

  [[nodiscard]] constexpr float on_the_state(const Input& input, float base_pct,
                                             float correction_pct) noexcept {
    // Holding, the force is an old one, and so is its rate.
    if (input.mode != LawMode::kHold) {
      follow_rate(input.force_n, state_.force_n, state_.force_rate_n_s);
      follow_rate(state_error_.model_force_n(), state_.model_force_n, state_.model_force_rate_n_s);
    }
    const StateErrorMrac::Input at{.force_n = state_.force_n,
                                   .force_rate_n_s = state_.force_rate_n_s,
                                   .model_force_rate_n_s = state_.model_force_rate_n_s,
                                   .force_reference_n = input.force_reference_n,
                                   .correction_mm_s = feed_mm_s_pct_ * correction_pct};
    if (input.mode == LawMode::kActive) return state_error_.step(at) / feed_mm_s_pct_;
    state_error_.follow(at, feed_mm_s_pct_ * base_pct);
    state_.model_force_n = state_.force_n;
    state_.model_force_rate_n_s = state_.force_rate_n_s;
    return base_pct;
  }

  [[nodiscard]] constexpr float on_the_output(const Input& input, float base_pct,
                                              float correction_pct) noexcept {
    const OutputErrorMrac::Input at{.force_n = input.force_n,
                                    .force_reference_n = input.force_reference_n,
                                    .correction_pct = correction_pct};
    if (input.mode == LawMode::kActive) return output_error_.step(at);
    output_error_.follow(at, base_pct);
    return base_pct;
  }

  // (C48): difference quotient behind a first-order low-pass.
  constexpr void follow_rate(float force_n, float& before_n, float& rate_n_s) const noexcept {
    rate_n_s += rate_ratio_ * ((force_n - before_n) / period_s_ - rate_n_s);
    before_n = force_n;
  }

  Form form_;
  float feed_mm_s_pct_;
  float period_s_;
  float rate_ratio_;
  StateErrorMrac state_error_;
  OutputErrorMrac output_error_;
  State state_{};
};

static_assert(Law<Mrac>);
static_assert(sizeof(Mrac::State) == (5 + 6 + 3) * 4);

}  // namespace cutforce::control
