#include "estimator/load_torque_filter.hpp"

#include <cmath>

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

// What both models share in a tick.
struct Shared {
  float g;
  float c;           // k g
  float into_speed;  // what the torque's noise adds to the variances: g^2 R_T,
  float into_both;   // k g^2 R_T
  float into_angle;  // k (2 - k) g^2 R_T
  float torque_nm;
  float moment_nm;
  float speed_rad_s;
  float centre_ratio;
  float speed_variance;
  float angle_variance;
  bool speed_valid;

  Shared(const LoadTorqueFilter::Input& in, const LoadTorqueFilter::Noise& noise) noexcept
      : g(in.duration_s / in.inertia_kg_m2),
        c(noise.centre_ratio * g),
        into_speed(g * g * noise.torque_variance),
        into_both(c * g * noise.torque_variance),
        into_angle(noise.centre_ratio * (2.0F - noise.centre_ratio) * g * g *
                   noise.torque_variance),
        torque_nm(in.torque_nm),
        moment_nm(in.moment_nm),
        // No measurement: alpha restarts at 0 with the tick, as if the prediction had been
        // measured.
        speed_rad_s(in.speed_valid ? in.speed_rad_s : 0.0F),
        centre_ratio(noise.centre_ratio),
        speed_variance(noise.speed_variance),
        angle_variance(noise.angle_variance),
        speed_valid(in.speed_valid) {}
};

// Both are inlined twice, on copies that live in registers: 400 instructions a tick for 530.
[[gnu::always_inline]] inline void predict(LoadTorqueFilter::Model& m, const Shared& in,
                                           float q2) noexcept {
  auto& [aa, aw, at, ww, wt, tt] = m.covariance;
  tt += q2;  // (E70)
  // w+ = w - g tau+, (E71)
  const float ww1 = ww - in.g * (2.0F * wt - in.g * tt) + in.into_speed;
  const float wt1 = wt - in.g * tt;
  const float aw1 = aw - in.g * at;
  // alpha+ = alpha + w+ + c tau+, (E72); torque noise enters w+ and leaves by -k.
  const float aw2 = aw1 + ww1 + in.c * wt1 - in.into_both;
  const float at2 = at + wt1 + in.c * tt;
  aa += 2.0F * (aw1 + in.c * at) + ww1 + in.c * (2.0F * wt1 + in.c * tt) + in.speed_variance -
        in.into_angle;
  aw = aw2;
  at = at2;
  ww = ww1;
  wt = wt1;

  const float acceleration = in.g * (in.torque_nm - m.mean[2]);
  m.mean[1] += acceleration;
  m.mean[0] += m.mean[1] - in.g * (in.moment_nm - in.centre_ratio * m.mean[2]) - in.speed_rad_s;
}

[[gnu::always_inline]] inline Innovation correct(LoadTorqueFilter::Model& m,
                                                 float angle_variance) noexcept {
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

// One model through the tick: mixed, predicted, corrected.
[[gnu::always_inline]] inline Innovation advance(LoadTorqueFilter::Model& model,
                                                 const std::array<float, 3>& from,
                                                 const std::array<float, 3>& apart, float share,
                                                 const Shared& in, float q2) noexcept {
  LoadTorqueFilter::Model m{
      .mean = {from[0] + share * apart[0], from[1] + share * apart[1], from[2] + share * apart[2]},
      .covariance = model.covariance};
  predict(m, in, q2);
  Innovation innovation{};
  if (in.speed_valid) {
    innovation = correct(m, in.angle_variance);
  } else {
    m.mean[0] = 0.0F;
    m.covariance[0] = m.covariance[1] = m.covariance[2] = 0.0F;
  }
  model = m;
  return innovation;
}

}  // namespace

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

  Model& quiet = state_.models[0];
  Model& edge = state_.models[1];
  // Mix before the step: each model starts from the weighted mean, (E74).
  const float mu_e = state_.edge_probability;
  const float mu_q = 1.0F - mu_e;
  const float edge_prior = mu_e * kStayEdge_ratio + mu_q * (1.0F - kStayQuiet_ratio);
  const float quiet_prior = 1.0F - edge_prior;
  const float into_quiet = mu_e * (1.0F - kStayEdge_ratio) / quiet_prior;  // share of edge
  const float into_edge = mu_e * kStayEdge_ratio / edge_prior;
  const auto difference = [&](std::size_t k) { return edge.mean[k] - quiet.mean[k]; };
  const std::array<float, 3> apart{difference(0), difference(1), difference(2)};

  const Shared shared(input, noise);
  const float q_edge = config_.edge_slope_1_s * input.duration_s * config_.rated_torque_nm;
  const float q_quiet2 = config_.drift_1_sqrt_s * config_.drift_1_sqrt_s * input.duration_s *
                         config_.rated_torque_nm * config_.rated_torque_nm;
  const std::array<float, 3> from = quiet.mean;
  const Innovation of_quiet = advance(quiet, from, apart, into_quiet, shared, q_quiet2);
  const Innovation of_edge = advance(edge, from, apart, into_edge, shared, q_edge * q_edge);

  float consistency = 1.0F;
  if (!input.speed_valid) {
    state_.edge_probability = edge_prior;
  } else if (of_quiet.variance > 0.0F && of_edge.variance > 0.0F) {
    const float quiet_misfit = of_quiet.value * of_quiet.value / of_quiet.variance;
    const float edge_misfit = of_edge.value * of_edge.value / of_edge.variance;
    // The ratio of likelihoods, exp(l) sqrt(s_q / s_e): a root for the logarithm of it.
    float l = 0.5F * (quiet_misfit - edge_misfit);
    if (l > kLargestLogRatio) l = kLargestLogRatio;
    if (!(l > -kLargestLogRatio)) l = -kLargestLogRatio;
    const float weighted =
        edge_prior * exp_bounded(l) * std::sqrt(of_quiet.variance / of_edge.variance);
    float p = weighted / (quiet_prior + weighted);
    if (p > 1.0F - kSmallestProbability) p = 1.0F - kSmallestProbability;
    if (!(p > kSmallestProbability)) p = kSmallestProbability;
    state_.edge_probability = p;
    consistency = (1.0F - p) * of_quiet.value * of_quiet.value / of_quiet.variance +
                  p * of_edge.value * of_edge.value / of_edge.variance;
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
