#include "estimator/run_up_inertia.hpp"

#include <cmath>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kTorqueError_ratio = 0.01F;  // of the run-up's torque: resistance, offsets
constexpr float kOffsetError_ratio = 0.03F;  // at rated speed, of offsets that nobody took out
constexpr float kTareError_ratio = 0.002F;   // of rated: friction differs while speeding up
constexpr float kWorthwhile_ratio = 0.05F;   // of the given variance: an episode below counts
constexpr float kLeastSigma_ratio = 0.005F;  // the torque's own errors repeat
constexpr float kFarthest_sigmas = 2.0F;

}  // namespace

void RunUpInertia::forget_episode() noexcept {
  state_.impulse_nm_s = state_.gained_rad_s = state_.time_s = state_.turned_rad = 0.0F;
  state_.calibrated = 1;
}

void RunUpInertia::gather(float torque_nm, float speed_rad_s, float duration_s,
                          bool calibrated) noexcept {
  State& s = state_;
  const float sign = speed_rad_s < 0.0F ? -1.0F : 1.0F;
  const float friction = config_.coulomb_torque_nm * sign + config_.viscous_nm_s_rad * speed_rad_s;
  s.impulse_nm_s += (torque_nm - friction) * duration_s;
  s.gained_rad_s += speed_rad_s - s.last_speed_rad_s;
  s.time_s += duration_s;
  s.turned_rad += speed_rad_s * sign * duration_s;
  if (!calibrated) s.calibrated = 0;
}

void RunUpInertia::close(float tare_nm) noexcept {
  find(tare_nm);
  forget_episode();
}

void RunUpInertia::find(float tare_nm) noexcept {
  State& s = state_;
  const float gained = magnitude(s.gained_rad_s);
  if (!(gained > 0.0F && s.time_s > 0.0F)) return;
  const float seen = (s.impulse_nm_s - tare_nm * s.time_s) / s.gained_rad_s;  // (E115)
  const float from_tare = kTareError_ratio * config_.rated_torque_nm * s.time_s / gained;
  float torque_error = kTorqueError_ratio;
  if (s.calibrated == 0 && s.turned_rad > 0.0F) {
    torque_error += kOffsetError_ratio * config_.rated_speed_rad_s * s.time_s / s.turned_rad;
  }
  const float from_torque = torque_error * seen;
  const float given_sigma = config_.inertia_sigma_ratio * config_.inertia_kg_m2;
  const float off_given = seen - config_.inertia_kg_m2;
  const float farthest = kFarthest_sigmas * given_sigma;
  if (!(off_given < farthest && off_given > -farthest)) return;
  const float variance = from_torque * from_torque + from_tare * from_tare;
  const float known = s.sigma_ratio * config_.inertia_kg_m2;
  if (!(variance < known * known || variance < kWorthwhile_ratio * given_sigma * given_sigma))
    return;
  const float gain = known * known / (known * known + variance);
  s.inertia_kg_m2 += gain * (seen - s.inertia_kg_m2);
  s.sigma_ratio *= std::sqrt(1.0F - gain);
  const float least = s.sigma_ratio < kLeastSigma_ratio ? kLeastSigma_ratio : s.sigma_ratio;
  s.sigma_ratio = least < config_.inertia_sigma_ratio ? least : config_.inertia_sigma_ratio;
}

}  // namespace cutforce::estimator
