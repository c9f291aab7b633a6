// P2's model reference adaptive law on the full state, (28)-(35); (C45)-(C51).
//
//   x = s [dF/dt, F] / b                       state of the plant's canonical form, scaled
//   z(k+1) = A_m z(k) + B_m r(k)               reference model, r = s F_r a_0m / b
//   w(k) = -mu B_m^T P (x(k) - z(k)) / n(k)    n = 1, as printed, or 1 + |x|^2 + r^2
//   [K(k), L(k)] = [K(k-1), L(k-1)] + w(k) [x(k)^T, r(k)]
//   u(k+1) = K(k) x(k) + L(k) r(k)             [mm/s], a tick later, as printed
//
// A_m, B_m: 1/((s + p_1)(s + p_2)), zero-order hold. P: A_m^T P A_m - P = -I, the equation of a
// discrete model; with P2's (33) the law would push the wrong way. mu means nothing without the
// scale s: the effective gain goes with mu s^3. As printed nothing proves stability, and from
// s = 10 on the loop diverges on the paper's own plant; it is here to be compared with.
// Own: L takes back what a limit took away, and adaptation never pushes further into a limit.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <expected>

#include "estimator/polynomials.hpp"

namespace cutforce::control {

// Row-major 2 by 2.
using Matrix2 = std::array<float, 4>;

struct ReferenceModel {
  Matrix2 transition;          // A_m
  std::array<float, 2> input;  // B_m
};

// Both poles [1/s] real, above 0, p2 above p1 by 1 % at least; (C46).
[[nodiscard]] constexpr ReferenceModel reference_model(float pole_1_hz, float pole_2_hz,
                                                       float period_s) noexcept {
  const float e1 = estimator::exp_bounded(-pole_1_hz * period_s);
  const float e2 = estimator::exp_bounded(-pole_2_hz * period_s);
  const float apart_hz = pole_2_hz - pole_1_hz;
  const float sum_hz = pole_1_hz + pole_2_hz;
  const float product_hz2 = pole_1_hz * pole_2_hz;
  const float h = (e1 - e2) / apart_hz;
  const float last = (pole_2_hz * e1 - pole_1_hz * e2) / apart_hz;
  return {.transition = {last - sum_hz * h, -product_hz2 * h, h, last},
          .input = {h, (1.0F - last) / product_hz2}};
}

struct Symmetric2 {
  float p11;
  float p12;
  float p22;
};

// P of A^T P A - P = -I, for A with both poles inside the unit circle: three linear equations,
// Cramer's rule; (C47).
[[nodiscard]] constexpr Symmetric2 stein_of_identity(const Matrix2& a) noexcept {
  const std::array<std::array<float, 3>, 3> m{{
      {a[0] * a[0] - 1.0F, 2.0F * a[0] * a[2], a[2] * a[2]},
      {a[0] * a[1], a[0] * a[3] + a[1] * a[2] - 1.0F, a[2] * a[3]},
      {a[1] * a[1], 2.0F * a[1] * a[3], a[3] * a[3] - 1.0F},
  }};
  // Right side [-1, 0, -1]; minors of the column that each unknown leaves.
  const auto minor = [&m](std::size_t row, std::size_t left, std::size_t right) {
    const std::size_t above = row == 0 ? 1 : 0;
    const std::size_t below = row == 2 ? 1 : 2;
    return m[above][left] * m[below][right] - m[above][right] * m[below][left];
  };
  const float determinant =
      m[0][0] * minor(0, 1, 2) - m[1][0] * minor(1, 1, 2) + m[2][0] * minor(2, 1, 2);
  return {.p11 = -(minor(0, 1, 2) + minor(2, 1, 2)) / determinant,
          .p12 = (minor(0, 0, 2) + minor(2, 0, 2)) / determinant,
          .p22 = -(minor(0, 0, 1) + minor(2, 0, 1)) / determinant};
}

class StateErrorMrac {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kPoles, kPlant, kScale, kGain };

  struct Config {
    float period_s;
    float model_pole_1_hz;  // p_1 [1/s], the slower
    float model_pole_2_hz;  // p_2 [1/s]
    float plant_n_mm_s2;    // b: numerator of the plant's second-order model, P2 (17)
    float state_scale_ratio;
    float adaptation_ratio;  // mu
    bool normalised;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s > 0.0F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      // Slower than a thousandth a tick P is lost to rounding; faster than 10 nothing is left.
      if (!(model_pole_1_hz * period_s >= 1e-3F && model_pole_2_hz >= 1.01F * model_pole_1_hz &&
            model_pole_2_hz * period_s <= 10.0F))
        return std::unexpected{ConfigError::kPoles};
      if (!(plant_n_mm_s2 >= 1e-3F && plant_n_mm_s2 <= 1e9F))
        return std::unexpected{ConfigError::kPlant};
      if (!(state_scale_ratio >= 1e-3F && state_scale_ratio <= 1e6F))
        return std::unexpected{ConfigError::kScale};
      if (!(adaptation_ratio > 0.0F && adaptation_ratio <= 1e6F))
        return std::unexpected{ConfigError::kGain};
      return {};
    }
  };

  struct Input {
    float force_n;
    float force_rate_n_s;        // however it was got
    float model_force_rate_n_s;  // the model's, got in the same way; (C48)
    float force_reference_n;     // above 0
    float correction_mm_s;       // what was taken from the last answer on its way; 0 mostly
  };

  struct State {
    std::array<float, 2> model{};  // z(k)
    std::array<float, 3> gains{};  // K, L [mm/s]
    float next_mm_s = 0.0F;        // u(k+1)
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<StateErrorMrac, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return StateErrorMrac{config};
  }

  // The feed [mm/s] that is to act from now on.
  [[nodiscard]] constexpr float step(const Input& input) noexcept {
    const Regressor at = regressor(input);
    state_.gains[2] += input.correction_mm_s / at.reference;  // (C50)
    state_.next_mm_s += input.correction_mm_s;
    const float rate_error = at.rate - scale_ * input.model_force_rate_n_s;
    const float norm =
        normalised_ ? 1.0F + at.rate * at.rate + at.force * at.force + at.reference * at.reference
                    : 1.0F;
    const float weight = -(row_[0] * rate_error + row_[1] * (at.force - state_.model[1])) / norm;
    if (!(weight * input.correction_mm_s < 0.0F)) {  // (C49), unless it pushes into the limit
      const std::array<float, 3> regressors{at.rate, at.force, at.reference};
      for (std::size_t i = 0; i < 3; ++i)
        state_.gains[i] = std::clamp(state_.gains[i] + weight * regressors[i], -kFar, kFar);
    }
    const auto& a = model_.transition;
    state_.model = {
        a[0] * state_.model[0] + a[1] * state_.model[1] + model_.input[0] * at.reference,
        a[2] * state_.model[0] + a[3] * state_.model[1] + model_.input[1] * at.reference};
    const float now_mm_s = state_.next_mm_s;
    state_.next_mm_s = std::clamp(
        state_.gains[0] * at.rate + state_.gains[1] * at.force + state_.gains[2] * at.reference,
        -kFar, kFar);
    return now_mm_s;
  }

  // Another decides: the model starts from the process, and L is the one that answers `feed_mm_s`.
  constexpr void follow(const Input& input, float feed_mm_s) noexcept {
    const Regressor at = regressor(input);
    state_.model = {at.rate, at.force};
    const float fed_back_mm_s = state_.gains[0] * at.rate + state_.gains[1] * at.force;
    state_.gains[2] = std::clamp((feed_mm_s - fed_back_mm_s) / at.reference, -kFar, kFar);  // (C51)
    state_.next_mm_s = feed_mm_s;
  }

  // z_2 as a force.
  [[nodiscard]] constexpr float model_force_n() const noexcept { return state_.model[1] / scale_; }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kFar = 1e9F;  // finite, however the printed law diverges

  struct Regressor {
    float rate;
    float force;
    float reference;
  };

  explicit constexpr StateErrorMrac(const Config& config) noexcept
      : model_(reference_model(config.model_pole_1_hz, config.model_pole_2_hz, config.period_s)),
        scale_(config.state_scale_ratio / config.plant_n_mm_s2),
        stiffness_(config.model_pole_1_hz * config.model_pole_2_hz),
        normalised_(config.normalised) {
    const auto p = stein_of_identity(model_.transition);
    const float mu = config.adaptation_ratio;
    row_ = {mu * (model_.input[0] * p.p11 + model_.input[1] * p.p12),
            mu * (model_.input[0] * p.p12 + model_.input[1] * p.p22)};
  }

  [[nodiscard]] constexpr Regressor regressor(const Input& input) const noexcept {
    return {.rate = scale_ * input.force_rate_n_s,
            .force = scale_ * input.force_n,
            .reference = scale_ * stiffness_ * input.force_reference_n};  // (C45)
  }

  ReferenceModel model_;
  std::array<float, 2> row_{};  // mu B_m^T P
  float scale_;                 // s / b
  float stiffness_;             // a_0m = p_1 p_2
  bool normalised_;
  State state_{};
};

}  // namespace cutforce::control
