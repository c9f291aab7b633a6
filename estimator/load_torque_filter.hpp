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
// They hang on no measurement, only on g, k and the variances: with every tick while they settle,
// then each model's in one tick of four, the gains standing in between.
// Source: ESTIMATOR prototype 1.3; the joint angle and speed form and its derivation: EQUATIONS.md.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "estimator/polynomials.hpp"

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

  // Of a correction: what stays of alpha, and what speed and torque take of the innovation.
  struct Gains {
    float keep = 0.0F;
    float speed = 0.0F;
    float torque = 0.0F;
    float certainty = 0.0F;  // 1 over the variance of the innovation
  };

  struct Model {
    std::array<float, 3> mean{};  // alpha, w, tau
    Gains gains{};
    std::array<float, 6> covariance{};  // aa, aw, at, ww, wt, tt
  };

  struct State {
    std::array<Model, 2> models{};  // quiet, edge
    float edge_probability = 0.5F;
    float likelihood_ratio = 1.0F;  // of edge over quiet at innovations of zero
    std::uint32_t ticks = 0;        // since the start, within the turn of four; 0: not started
  };

  [[nodiscard]] static constexpr std::expected<LoadTorqueFilter, ConfigError> make(
      const Config& config) noexcept;

  [[nodiscard, gnu::always_inline]] Output step(const Input& input, const Noise& noise) noexcept;

  // Starts both models at this speed and torque, with their uncertainties.
  void start(float speed_rad_s, float speed_sigma_rad_s, float torque_nm,
             float torque_sigma_nm) noexcept;

  // The torque's scale or offset changed: forget by this much.
  void loosen(float torque_sigma_nm) noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kStayQuiet_ratio = 0.999F;
  static constexpr float kStayEdge_ratio = 0.97F;
  static constexpr float kSmallestProbability = 1e-4F;
  static constexpr float kLargestLogRatio = 40.0F;
  static constexpr float kLog2OfE = 1.44269504F;
  // Both recursions run with every tick for so long, then in turn; with the noise of counts always,
  // for that moves from tick to tick.
  static constexpr std::uint32_t kSettling = 256;  // ticks; a noisy speed's quiet model takes 100
  static constexpr std::uint32_t kResettling = kSettling - 128;  // after a change of the noise
  static constexpr std::uint32_t kTurn = 4;

  struct Prior;
  struct Means;

  explicit constexpr LoadTorqueFilter(const Config& config) noexcept : config_(config) {}
  void renew_due(const Input& input, const Noise& noise, float g) noexcept;
  void renew(Model& model, float q2, float g, Noise noise) noexcept;
  [[nodiscard]] Output mixture(float consistency_ratio, float innovation_rad_s) const noexcept;
  [[nodiscard]] Output only_predict(const Input& input, const Noise& noise) noexcept;

  Config config_;
  State state_{};
};

constexpr auto LoadTorqueFilter::make(const Config& config) noexcept
    -> std::expected<LoadTorqueFilter, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return LoadTorqueFilter{config};
}

// What a tick needs of (E74) before the step: where each model starts between quiet and edge.
struct LoadTorqueFilter::Prior {
  float edge;
  float quiet;
  float into_quiet;  // share of edge
  float into_edge;

  explicit Prior(float edge_probability) noexcept
      : edge((kStayEdge_ratio - (1.0F - kStayQuiet_ratio)) * edge_probability +
             (1.0F - kStayQuiet_ratio)),
        quiet(1.0F - edge),
        into_quiet((1.0F - kStayEdge_ratio) * edge_probability / quiet),
        into_edge(kStayEdge_ratio * edge_probability / edge) {}
};

// Means of one model through the tick: mixed, predicted, corrected; returns the innovation.
struct LoadTorqueFilter::Means {
  std::array<float, 3> from;   // quiet, before the tick
  std::array<float, 3> apart;  // edge less quiet
  float g;
  float c;       // k g
  float pushed;  // g T_m
  float turned;  // g M + w_m

  [[gnu::always_inline]] float follow(Model& m, float share) const noexcept {
    const float torque = from[2] + share * apart[2];
    const float speed = from[1] + share * apart[1] + (pushed - g * torque);
    const float r = turned - c * torque - (from[0] + share * apart[0] + speed);
    m.mean = {-(m.gains.keep * r), speed + m.gains.speed * r, torque + m.gains.torque * r};
    return r;
  }
};

[[gnu::always_inline]] inline void LoadTorqueFilter::renew_due(const Input& input,
                                                               const Noise& noise,
                                                               float g) noexcept {
  const std::uint32_t tick = noise.angle_variance > 0.0F ? 1 : state_.ticks;
  state_.ticks = tick + 1 < kSettling + kTurn ? tick + 1 : kSettling;
  const float rated = config_.rated_torque_nm;
  if (tick < kSettling || tick % kTurn == 0) {
    const float drift = config_.drift_1_sqrt_s * rated;
    renew(state_.models[0], drift * drift * input.duration_s, g, noise);
  }
  if (tick < kSettling || tick % kTurn == 2) {
    const float slope = config_.edge_slope_1_s * rated * input.duration_s;
    renew(state_.models[1], slope * slope, g, noise);
  }
}

[[gnu::always_inline]] inline auto LoadTorqueFilter::mixture(float consistency_ratio,
                                                             float innovation_rad_s) const noexcept
    -> Output {
  const auto& [quiet, edge] = state_.models;
  const float p = state_.edge_probability;
  const float spread = edge.mean[2] - quiet.mean[2];
  const float wider = edge.covariance[5] - quiet.covariance[5];
  return {.load_torque_nm = quiet.mean[2] + p * spread,
          .variance_nm2 = quiet.covariance[5] + p * (wider + (1.0F - p) * spread * spread),
          .speed_rad_s = quiet.mean[1] + p * (edge.mean[1] - quiet.mean[1]),
          .edge_probability = p,
          .consistency_ratio = consistency_ratio,
          .innovation_rad_s = innovation_rad_s};
}

inline auto LoadTorqueFilter::step(const Input& in, const Noise& noise) noexcept -> Output {
  if (state_.ticks == 0) [[unlikely]]
    start(in.speed_rad_s, 1.0F, in.torque_nm, config_.rated_torque_nm);
  if (!in.speed_valid) [[unlikely]]
    return only_predict(Input{in}, Noise{noise});
  const float g = in.duration_s / in.inertia_kg_m2;
  renew_due(in, noise, g);

  auto& [quiet, edge] = state_.models;
  const Prior prior(state_.edge_probability);
  const Means means{.from = quiet.mean,
                    .apart = {edge.mean[0] - quiet.mean[0], edge.mean[1] - quiet.mean[1],
                              edge.mean[2] - quiet.mean[2]},
                    .g = g,
                    .c = noise.centre_ratio * g,
                    .pushed = g * in.torque_nm,
                    .turned = g * in.moment_nm + in.speed_rad_s};
  const float of_quiet = means.follow(quiet, prior.into_quiet);
  const float of_edge = means.follow(edge, prior.into_edge);

  const float quiet_misfit = of_quiet * of_quiet * quiet.gains.certainty;
  const float edge_misfit = of_edge * of_edge * edge.gains.certainty;
  const float apart = quiet_misfit - edge_misfit;
  // The ratio of likelihoods, as a power of two.
  float l = 0.5F * kLog2OfE * apart;
  if (l > kLargestLogRatio) l = kLargestLogRatio;
  if (!(l > -kLargestLogRatio)) l = -kLargestLogRatio;
  const float weighted = prior.edge * state_.likelihood_ratio * exp2_coarse(l);
  float p = weighted / (prior.quiet + weighted);
  if (p > 1.0F - kSmallestProbability) p = 1.0F - kSmallestProbability;
  if (!(p > kSmallestProbability)) p = kSmallestProbability;
  state_.edge_probability = p;
  return mixture(quiet_misfit - p * apart, of_quiet);
}

static_assert(std::is_trivially_copyable_v<LoadTorqueFilter>);

}  // namespace cutforce::estimator
