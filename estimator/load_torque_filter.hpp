// Load torque from air-gap torque and shaft angle or speed: two Kalman filters, mixed.
//
// States of one model: alpha = (modelled - measured shaft angle) / h  [rad/s], w speed [rad/s],
// tau load torque [N m]. Over one tick of h seconds, g = h / J:
//   tau+   = tau + d,               d ~ (0, q^2)                                          (E70)
//   w+     = w + g (T_m - tau+)                                                           (E71)
//   alpha+ = alpha + w+ - g (M - k tau+) - w_m + e,    e ~ (0, R_w)                      (E72)
//   0      = alpha+ + n,            n ~ (0, R_a)                                          (E73)
// w_m is the mean measured speed of the tick, T_m the mean torque with noise variance R_T,
// M its first moment (M = k T_m for a constant torque). White
// speed noise enters as e, bounded angle noise (encoder counts, flux angle) as n: with R_a = 0
// this is the two-state filter on speed, with R_w = 0 the three-state filter on counts. k centres
// the mean: (n-1)/(2n) for n instantaneous samples ending with the tick, 1/2 for counts.
//
// `quiet` has a small q (drift in the cut), `edge` a large one (steepest slope to be followed);
// they are mixed by their likelihoods (interacting multiple models, fixed stay probabilities).
// Covariances run as plain Riccati recursions of each model, not mixed, so that the gains settle.
// Source: ESTIMATOR prototype 1.3; the joint angle and speed form and its derivation: EQUATIONS.md.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <type_traits>

namespace cutforce::estimator {

class LoadTorqueFilter {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kTorque, kSlope };

  struct Config {
    float tick_s;           // nominal
    float rated_torque_nm;  // scales everything below
    float edge_slope_1_s;   // steepest slope to be followed, rated torques per second
    float drift_1_sqrt_s;   // drift in the cut, rated torques per root second

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(tick_s > 0.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(rated_torque_nm > 0.0F)) return std::unexpected{ConfigError::kTorque};
      if (!(edge_slope_1_s > 0.0F && drift_1_sqrt_s > 0.0F))
        return std::unexpected{ConfigError::kSlope};
      return {};
    }
  };

  struct Noise {
    float speed_variance;   // R_w, (rad/s)^2, white part of one tick's mean
    float angle_variance;   // R_a, (rad/s)^2: angle noise variance / h^2
    float torque_variance;  // R_T, (N m)^2, of one tick's mean
    float centre_ratio;     // k
  };

  struct Input {
    float torque_nm;    // T_m
    float moment_nm;    // M
    float speed_rad_s;  // w_m
    float duration_s;   // of this tick
    float inertia_kg_m2;
    bool speed_valid;  // false: predict only
  };

  struct Output {
    float load_torque_nm;
    float variance_nm2;  // of the mixture
    float speed_rad_s;   // filtered, end of the tick
    float edge_probability;
    float consistency_ratio;  // squared innovation over its expected variance, mixed
    float innovation_rad_s;   // of the quiet model
  };

  struct Model {
    std::array<float, 3> mean{};        // alpha, w, tau
    std::array<float, 6> covariance{};  // aa, aw, at, ww, wt, tt
  };

  struct State {
    std::array<Model, 2> models{};  // quiet, edge
    float edge_probability = 0.5F;
    std::uint32_t started = 0;
  };

  [[nodiscard]] static constexpr std::expected<LoadTorqueFilter, ConfigError> make(
      const Config& config) noexcept;

  [[nodiscard]] Output step(const Input& input, const Noise& noise) noexcept;

  // Starts both models at this speed and torque, with their uncertainties.
  void start(float speed_rad_s, float speed_sigma_rad_s, float torque_nm,
             float torque_sigma_nm) noexcept;

  // The torque's scale or offset changed: forget by this much.
  void loosen(float torque_sigma_nm) noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  explicit constexpr LoadTorqueFilter(const Config& config) noexcept : config_(config) {}

  Config config_;
  State state_{};
};

constexpr auto LoadTorqueFilter::make(const Config& config) noexcept
    -> std::expected<LoadTorqueFilter, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return LoadTorqueFilter{config};
}

static_assert(std::is_trivially_copyable_v<LoadTorqueFilter>);

}  // namespace cutforce::estimator
