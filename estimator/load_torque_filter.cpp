#include "estimator/load_torque_filter.hpp"

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kStayQuiet_ratio = 0.999F;
constexpr float kStayEdge_ratio = 0.97F;
constexpr float kSmallestProbability = 1e-4F;
constexpr float kLargestLogRatio = 40.0F;

struct Innovation {
  float value;
  float variance;
};

void predict(LoadTorqueFilter::Model& m, const LoadTorqueFilter::Input& in,
             const LoadTorqueFilter::Noise& noise, float g, float q2) noexcept {
  auto& [aa, aw, at, ww, wt, tt] = m.covariance;
  tt += q2;  // (E70)
  // w+ = w - g tau+, (E71)
  const float ww1 = ww - g * (2.0F * wt - g * tt) + g * g * noise.torque_variance;
  const float wt1 = wt - g * tt;
  const float aw1 = aw - g * at;
  // alpha+ = alpha + w+ + c tau+, (E72); torque noise enters w+ and leaves by -k.
  const float c = noise.centre_ratio * g;
  const float aw2 = aw1 + ww1 + c * wt1 - noise.centre_ratio * g * g * noise.torque_variance;
  const float at2 = at + wt1 + c * tt;
  aa += 2.0F * (aw1 + c * at) + ww1 + c * (2.0F * wt1 + c * tt) + noise.speed_variance -
        noise.centre_ratio * (2.0F - noise.centre_ratio) * g * g * noise.torque_variance;
  aw = aw2;
  at = at2;
  ww = ww1;
  wt = wt1;

  const float acceleration = g * (in.torque_nm - m.mean[2]);
  m.mean[1] += acceleration;
  m.mean[0] += m.mean[1] - g * (in.moment_nm - noise.centre_ratio * m.mean[2]) - in.speed_rad_s;
}

Innovation correct(LoadTorqueFilter::Model& m, float angle_variance) noexcept {
  auto& [aa, aw, at, ww, wt, tt] = m.covariance;
  const float s = aa + angle_variance;
  const float r = -m.mean[0];
  const float inverse = s > 0.0F ? 1.0F / s : 0.0F;
  const float ka = aa * inverse;
  const float kw = aw * inverse;
  const float kt = at * inverse;
  m.mean[0] += ka * r;
  m.mean[1] += kw * r;
  m.mean[2] += kt * r;
  ww -= kw * aw;
  wt -= kw * at;
  tt -= kt * at;
  const float keep = angle_variance * inverse;  // 1 - ka without cancellation
  aa *= keep;
  aw *= keep;
  at *= keep;
  if (!(ww > 0.0F)) ww = 0.0F;
  if (!(tt > 0.0F)) tt = 0.0F;
  return {.value = r, .variance = s};
}

}  // namespace

auto LoadTorqueFilter::make(const Config& config) noexcept
    -> std::expected<LoadTorqueFilter, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return LoadTorqueFilter{config};
}

void LoadTorqueFilter::start(float speed_rad_s, float speed_sigma_rad_s, float torque_nm,
                             float torque_sigma_nm) noexcept {
  for (Model& m : state_.models) {
    m.mean = {0.0F, speed_rad_s, torque_nm};
    m.covariance = {0.0F, 0.0F,
                    0.0F, speed_sigma_rad_s * speed_sigma_rad_s,
                    0.0F, torque_sigma_nm * torque_sigma_nm};
  }
  state_.edge_probability = 0.5F;
  state_.started = 1;
}

void LoadTorqueFilter::loosen(float torque_sigma_nm) noexcept {
  for (Model& m : state_.models) m.covariance[5] += torque_sigma_nm * torque_sigma_nm;
}

auto LoadTorqueFilter::step(const Input& input, const Noise& noise) noexcept -> Output {
  if (state_.started == 0) start(input.speed_rad_s, 1.0F, input.torque_nm, config_.rated_torque_nm);

  auto& [quiet, edge] = state_.models;
  // Mix before the step: each model starts from the weighted mean, (E74).
  const float mu_e = state_.edge_probability;
  const float mu_q = 1.0F - mu_e;
  const float edge_prior = mu_e * kStayEdge_ratio + mu_q * (1.0F - kStayQuiet_ratio);
  const float quiet_prior = 1.0F - edge_prior;
  const float into_quiet = mu_e * (1.0F - kStayEdge_ratio) / quiet_prior;  // share of edge
  const float into_edge = mu_e * kStayEdge_ratio / edge_prior;
  for (std::size_t k = 0; k < 3; ++k) {
    const float q = quiet.mean[k];
    const float d = edge.mean[k] - q;
    quiet.mean[k] = q + into_quiet * d;
    edge.mean[k] = q + into_edge * d;
  }

  const float g = input.duration_s / input.inertia_kg_m2;
  const float q_edge = config_.edge_slope_1_s * input.duration_s * config_.rated_torque_nm;
  const float q_quiet2 = config_.drift_1_sqrt_s * config_.drift_1_sqrt_s * input.duration_s *
                         config_.rated_torque_nm * config_.rated_torque_nm;
  Input used = input;
  if (!input.speed_valid) {
    // No measurement: alpha restarts at 0 with the tick, as if the prediction had been measured.
    used.speed_rad_s = 0.0F;
  }
  predict(quiet, used, noise, g, q_quiet2);
  predict(edge, used, noise, g, q_edge * q_edge);
  if (!input.speed_valid) {
    for (Model& m : state_.models) {
      m.mean[0] = 0.0F;
      m.covariance[0] = m.covariance[1] = m.covariance[2] = 0.0F;
    }
  }

  Innovation of_quiet{};
  float consistency = 1.0F;
  if (input.speed_valid) {
    of_quiet = correct(quiet, noise.angle_variance);
    const Innovation of_edge = correct(edge, noise.angle_variance);
    if (of_quiet.variance > 0.0F && of_edge.variance > 0.0F) {
      float l = 0.5F * (of_quiet.value * of_quiet.value / of_quiet.variance -
                        of_edge.value * of_edge.value / of_edge.variance +
                        log_positive(of_quiet.variance / of_edge.variance));
      if (l > kLargestLogRatio) l = kLargestLogRatio;
      if (!(l > -kLargestLogRatio)) l = -kLargestLogRatio;
      const float weighted = edge_prior * exp_bounded(l);
      float p = weighted / (quiet_prior + weighted);
      if (p > 1.0F - kSmallestProbability) p = 1.0F - kSmallestProbability;
      if (!(p > kSmallestProbability)) p = kSmallestProbability;
      state_.edge_probability = p;
      consistency = (1.0F - p) * of_quiet.value * of_quiet.value / of_quiet.variance +
                    p * of_edge.value * of_edge.value / of_edge.variance;
    }
  } else {
    state_.edge_probability = edge_prior;
  }

  const float p = state_.edge_probability;
  const float spread = edge.mean[2] - quiet.mean[2];
  return {.load_torque_nm = quiet.mean[2] + p * spread,
          .variance_nm2 = (1.0F - p) * quiet.covariance[5] + p * edge.covariance[5] +
                          p * (1.0F - p) * spread * spread,
          .speed_rad_s = quiet.mean[1] + p * (edge.mean[1] - quiet.mean[1]),
          .edge_probability = p,
          .consistency_ratio = consistency,
          .innovation_rad_s = of_quiet.value};
}

}  // namespace cutforce::estimator
