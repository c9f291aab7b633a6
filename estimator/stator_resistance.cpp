#include "estimator/stator_resistance.hpp"

#include <cmath>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kBlock_s = 0.05F;
constexpr float kModelError_ratio = 0.02F;  // flux, slip, torque: saturation moves R_R
constexpr float kModelCount = 20.0F;        // blocks that share that error
constexpr float kSlipNoise_rad_s = 0.02F;   // of a block's mean
constexpr float kSteady_ratio = 0.02F;      // torque may move by this much of rated within a block
constexpr float kScatterShare = 0.2F;
constexpr float kScatterCount = 12.0F;  // slow noise: blocks are not independent

}  // namespace

void StatorResistance::step(const Input& in) noexcept {
  auto& s = state_.sums;
  if (!stands_out(in.idle_copper_nm_ohm, in.frequency_rad_s)) {
    pause();
    return;
  }
  const float moved = in.torque_nm - state_.first_torque_nm;
  const float limit = kSteady_ratio * config_.rated_torque_nm;
  if (!in.steady || moved > limit || moved < -limit) {
    forget();
    state_.first_torque_nm = in.torque_nm;
    if (!in.steady) return;
  }
  const float w = in.frequency_rad_s;
  const float x =
      1.5F * in.current_squared_a2 * config_.pole_pairs / (w > 1.0F || w < -1.0F ? w : 1.0F);
  s[0] += in.flux_squared * in.duration_s;
  s[1] += (in.flux_frequency_rad_s - config_.pole_pairs * in.speed_rad_s) * in.duration_s;
  s[2] += in.torque_nm * in.duration_s;
  s[3] += x * in.duration_s;
  s[4] += w * in.duration_s;
  s[5] += in.duration_s;
  if (s[5] >= kBlock_s) {
    learn();
    find_change();
    s.fill(0.0F);
    state_.first_torque_nm = in.torque_nm;
  }
}

void StatorResistance::learn() noexcept {
  const auto& s = state_.sums;
  const float torque = s[2] / s[5];
  const float x = s[3] / s[5];
  const float speed_ratio = s[4] / s[5] / config_.rated_frequency_rad_s;

  const float flux2 = s[0] / s[5];
  const float y = flux2 * s[1] / s[5];
  const float a = state_.mean[0];
  const float slip_noise = flux2 * kSlipNoise_rad_s;
  const float model = kModelError_ratio * a * magnitude(torque);
  const std::array<float, 3> h{torque, -x, -speed_ratio};  // (E110)
  const float r = y - (h[0] * state_.mean[0] + h[1] * state_.mean[1] + h[2] * state_.mean[2]);
  if (state_.blocks++ == 0) {
    // The first block after a change may hold some of it: it only starts the comparison.
    state_.last_rest = r;
    return;
  }
  const float change = r - state_.last_rest;
  state_.last_rest = r;
  state_.scatter += kScatterShare * (0.5F * change * change - state_.scatter);
  const float noise =
      slip_noise * slip_noise + kScatterCount * state_.scatter + kModelCount * model * model;

  auto& [p00, p01, p02, p11, p12, p22] = state_.covariance;
  const float g0 = p00 * h[0] + p01 * h[1] + p02 * h[2];
  const float g1 = p01 * h[0] + p11 * h[1] + p12 * h[2];
  const float g2 = p02 * h[0] + p12 * h[1] + p22 * h[2];
  const float variance = h[0] * g0 + h[1] * g1 + h[2] * g2 + noise;
  if (!(variance > 0.0F)) return;
  const float scale = 1.0F / variance;
  state_.mean[0] += g0 * scale * r;
  state_.mean[1] += g1 * scale * r;
  state_.mean[2] += g2 * scale * r;
  p00 -= g0 * g0 * scale;
  p01 -= g0 * g1 * scale;
  p02 -= g0 * g2 * scale;
  p11 -= g1 * g1 * scale;
  p12 -= g1 * g2 * scale;
  p22 -= g2 * g2 * scale;
  if (!(p00 > 0.0F)) p00 = 0.0F;
  if (!(p11 > 0.0F)) p11 = 0.0F;
  if (!(p22 > 0.0F)) p22 = 0.0F;
}

}  // namespace cutforce::estimator
