#include "estimator/load_torque_filter.hpp"

#include <cmath>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kUnsettled_ratio = 0.1F;  // of 1/S, from one step of a recursion to the next

using Model = LoadTorqueFilter::Model;

// Covariance over one tick, (E70) to (E72), of a model that drifts by q2.
[[gnu::always_inline]] inline void predict(std::array<float, 6>& covariance, float g,
                                           const LoadTorqueFilter::Noise& noise,
                                           float q2) noexcept {
  auto [aa, aw, at, ww, wt, tt] = covariance;
  const float k = noise.centre_ratio;
  const float c = k * g;
  const float push = g * g * noise.torque_variance;  // of the torque's noise into the speed
  tt += q2;                                          // (E70)
  // w+ = w - g tau+, (E71)
  const float ww1 = ww - g * (2.0F * wt - g * tt) + push;
  const float wt1 = wt - g * tt;
  const float aw1 = aw - g * at;
  // alpha+ = alpha + w+ + c tau+, (E72); torque noise enters w+ and leaves by -k.
  aa += 2.0F * (aw1 + c * at) + ww1 + c * (2.0F * wt1 + c * tt) + noise.speed_variance -
        k * (2.0F - k) * push;
  covariance = {aa, aw1 + ww1 + c * wt1 - k * push, at + wt1 + c * tt, ww1, wt1, tt};
}

// What the measurement of alpha leaves, and the gains of it, (E73).
[[gnu::always_inline]] inline void correct(Model& m, float angle_variance) noexcept {
  auto [aa, aw, at, ww, wt, tt] = m.covariance;
  const float s = aa + angle_variance;
  const float certainty = s > 0.0F ? 1.0F / s : 0.0F;
  const float keep = angle_variance * certainty;  // 1 - K_a without cancellation
  const float speed = aw * certainty;
  const float torque = at * certainty;
  ww -= speed * aw;
  wt -= speed * at;
  tt -= torque * at;
  if (!(ww > 0.0F)) ww = 0.0F;
  if (!(tt > 0.0F)) tt = 0.0F;
  m.gains = {.keep = keep, .speed = speed, .torque = torque, .certainty = certainty};
  m.covariance = {aa * keep, aw * keep, at * keep, ww, wt, tt};
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
  state_.ticks = 1;
}

void LoadTorqueFilter::loosen(float torque_sigma_nm) noexcept {
  for (Model& m : state_.models) m.covariance[5] += torque_sigma_nm * torque_sigma_nm;
  if (state_.ticks > 1) state_.ticks = 1;
}

[[gnu::noinline]] void LoadTorqueFilter::renew(Model& model, float q2, float g,
                                               Noise noise) noexcept {
  const float before = model.gains.certainty;
  predict(model.covariance, g, noise, q2);
  correct(model, noise.angle_variance);
  // The noise is another than a while ago: the recursions settle anew.
  if (magnitude(model.gains.certainty - before) > kUnsettled_ratio * before &&
      state_.ticks > kResettling)
    state_.ticks = kResettling;
  const float quiet = state_.models[0].gains.certainty;
  const float edge = state_.models[1].gains.certainty;
  state_.likelihood_ratio = quiet > 0.0F ? std::sqrt(edge / quiet) : 1.0F;
}

// No measurement: alpha begins anew at 0 with the next tick, as if the prediction had been
// measured.
[[gnu::noinline]] auto LoadTorqueFilter::only_predict(const Input& in, const Noise& noise) noexcept
    -> Output {
  const Prior prior(state_.edge_probability);
  auto& [quiet, edge] = state_.models;
  const float g = in.duration_s / in.inertia_kg_m2;
  const float rated = config_.rated_torque_nm;
  const float drift = config_.drift_1_sqrt_s * rated;
  const float slope = config_.edge_slope_1_s * rated * in.duration_s;
  const std::array<float, 3> from = quiet.mean;
  const auto mixed = [&](std::size_t k, float share) {
    return from[k] + share * (state_.models[1].mean[k] - from[k]);
  };
  const float quiet_nm = mixed(2, prior.into_quiet);
  const float edge_nm = mixed(2, prior.into_edge);
  const float quiet_rad_s = mixed(1, prior.into_quiet);
  const float edge_rad_s = mixed(1, prior.into_edge);
  quiet.mean = {0.0F, quiet_rad_s + g * (in.torque_nm - quiet_nm), quiet_nm};
  edge.mean = {0.0F, edge_rad_s + g * (in.torque_nm - edge_nm), edge_nm};
  predict(quiet.covariance, g, noise, drift * drift * in.duration_s);
  predict(edge.covariance, g, noise, slope * slope);
  for (Model& m : state_.models) m.covariance[0] = m.covariance[1] = m.covariance[2] = 0.0F;
  state_.edge_probability = prior.edge;
  state_.ticks = 1;
  return mixture(1.0F, 0.0F);
}

}  // namespace cutforce::estimator
