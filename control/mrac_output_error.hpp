// Model reference adaptive law on the force alone, (C52)-(C56). Own; the usable one.
//
//   F_m(i+1) = F_m(i) + (1 - exp(-T/tau_m)) (F_r - F_m(i))    what the force is to do
//   U(i) = S (1 + rho (x - 1)),   x = F/F_r,  S = F_r c        c = 1/k [%/N], inverse process gain
//        = theta_r + theta_x x,   theta_r = S (1 - rho), theta_x = S rho
//   [theta_r, theta_x] += -gamma T S (F - F_m)/F_r [1, x] / (2 + x^2)
//
// It is the gradient rule of P2 (31), (32) for a first-order model, normalised: the force answers a
// parameter by k = F_r / S, hence the factor S, and the loop's speed does not depend on the depth
// of cut. At rest U = S, so that c is the inverse of the process gain whatever rho is; rho is how
// the cut's own lag tau differs from the model's, 1 - tau/tau_m, and is kept in -1 ... 0.5, x - 1
// in -1 ... 0.5: U stays between S/2 and 2 S.
#pragma once

#include <algorithm>
#include <cstdint>
#include <expected>

#include "estimator/polynomials.hpp"

namespace cutforce::control {

class OutputErrorMrac {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kModel, kGain, kRange };

  struct Config {
    float period_s;
    float model_time_s;       // tau_m
    float adaptation_hz;      // gamma [1/s]
    float gain_lowest_n_pct;  // of the process, static
    float gain_highest_n_pct;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s > 0.0F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(model_time_s >= 0.1F * period_s && model_time_s <= 1e4F * period_s))
        return std::unexpected{ConfigError::kModel};
      // A step of the parameters larger than the parameters is no gradient any more.
      if (!(adaptation_hz > 0.0F && adaptation_hz * period_s <= 1.0F))
        return std::unexpected{ConfigError::kGain};
      if (!(gain_lowest_n_pct >= 1e-4F && gain_lowest_n_pct < gain_highest_n_pct &&
            gain_highest_n_pct <= 1e6F))
        return std::unexpected{ConfigError::kRange};
      return {};
    }
  };

  struct Input {
    float force_n;
    float force_reference_n;  // above 0
    float correction_pct;     // what was taken from the last answer on its way; 0 mostly
  };

  struct State {
    float inverse_gain_pct_n = 1.0F;  // c
    float feedback_ratio = 0.0F;      // rho
    float model_n = 0.0F;             // F_m
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<OutputErrorMrac, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return OutputErrorMrac{config};
  }

  [[nodiscard]] constexpr float step(const Input& input) noexcept {
    const float x = input.force_n / input.force_reference_n;
    const float error = (input.force_n - state_.model_n) / input.force_reference_n;
    // What a limit took away the override at rest gives up too.
    float total_pct = state_.inverse_gain_pct_n * input.force_reference_n +
                      input.correction_pct / factor(x);  // (C55)
    const float most_pct = input.force_reference_n / gain_lowest_n_pct_;
    const float least_pct = input.force_reference_n / gain_highest_n_pct_;
    total_pct = std::clamp(total_pct, least_pct, most_pct);
    const float change_pct = -adaptation_ * total_pct * error / (2.0F + x * x);  // (C54)
    if (!(change_pct * input.correction_pct < 0.0F)) {
      const float fed_back_pct = state_.feedback_ratio * total_pct + change_pct * x;
      total_pct = std::clamp(total_pct + change_pct * (1.0F + x), least_pct, most_pct);
      state_.feedback_ratio = std::clamp(fed_back_pct / total_pct, kLeastFeedback, kMostFeedback);
    }
    state_.inverse_gain_pct_n = total_pct / input.force_reference_n;
    state_.model_n += model_ratio_ * (input.force_reference_n - state_.model_n);  // (C52)
    return total_pct * factor(x);                                                 // (C53)
  }

  // Another decides: the model starts from the force, and c is the one that answers `override_pct`.
  constexpr void follow(const Input& input, float override_pct) noexcept {
    const float x = input.force_n / input.force_reference_n;
    state_.model_n = input.force_n;
    state_.inverse_gain_pct_n = override_pct / (factor(x) * input.force_reference_n);  // (C56)
  }

  [[nodiscard]] constexpr float process_gain_n_pct() const noexcept {
    return std::clamp(1.0F / std::max(state_.inverse_gain_pct_n, 1e-9F), gain_lowest_n_pct_,
                      gain_highest_n_pct_);
  }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kLeastFeedback = -1.0F;
  static constexpr float kMostFeedback = 0.5F;

  explicit constexpr OutputErrorMrac(const Config& config) noexcept
      : model_ratio_(1.0F - estimator::exp_bounded(-config.period_s / config.model_time_s)),
        adaptation_(config.adaptation_hz * config.period_s),
        gain_lowest_n_pct_(config.gain_lowest_n_pct),
        gain_highest_n_pct_(config.gain_highest_n_pct) {}

  // U / S, 0.5 to 2.
  [[nodiscard]] constexpr float factor(float x) const noexcept {
    return 1.0F + state_.feedback_ratio * (std::min(x, 1.5F) - 1.0F);
  }

  float model_ratio_;
  float adaptation_;  // gamma T
  float gain_lowest_n_pct_;
  float gain_highest_n_pct_;
  State state_{};
};

}  // namespace cutforce::control
