#include "estimator/air_cut.hpp"

#include <cmath>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kSlopeTime_s = 0.05F;
constexpr float kUnsteady_ratio = 0.03F;  // of the rated torque, as acceleration torque
constexpr float kTareTime_s = 0.3F;
constexpr float kSnapshot_s = 0.025F;
constexpr float kShortestWait_s = 0.06F;
constexpr float kEven_s = 0.02F;
constexpr float kNoiseWait_s = 0.15F;
constexpr float kNoisySpeed_rad_s = 0.2F;
constexpr float kTorqueFloor_ratio = 1e-3F;
constexpr float kTareSigma_ratio = 0.02F;
constexpr float kSettled_s = 0.5F;
constexpr float kDrift_ratio_s = 0.004F;
constexpr float kLongestWait_s = 1.2F;
constexpr float kYoungTare_s = 0.06F;
constexpr float kLargestThreshold_ratio = 0.06F;
constexpr float kAging_ratio_sqrt_s = 5e-4F;  // friction drifts between tare and cut
constexpr float kUnknownFriction_ratio = 0.05F;
constexpr float kReturn_ratio = 0.05F;  // believed as idle after a change of speed

}  // namespace

void AirCut::tare(float y_nm, float variance_nm2, float duration_s) noexcept {
  state_.idle_s += duration_s;
  const float time_s = state_.idle_s < kTareTime_s ? state_.idle_s : kTareTime_s;
  const float share = duration_s / (time_s > duration_s ? time_s : duration_s);
  const float deviation = y_nm - state_.tare_nm;
  if (state_.has_tare == 0 || state_.idle_s <= duration_s)
    state_.variance_nm2 = deviation * deviation;
  const float floor_nm = kTorqueFloor_ratio * config_.rated_torque_nm;
  const float weight = 1.0F / (variance_nm2 + floor_nm * floor_nm);
  state_.tare_weight = (1.0F - duration_s / kTareTime_s) * state_.tare_weight + weight;
  float moved = deviation * weight / state_.tare_weight;  // (E91)
  if (state_.idle_s > kSettled_s) {
    // Friction drifts slowly; what is faster is a cut that begins gently.
    const float most = kDrift_ratio_s * config_.rated_torque_nm * duration_s;
    moved = moved > most ? most : (moved < -most ? -most : moved);
  }
  state_.tare_nm += moved;
  state_.variance_nm2 += share * (deviation * deviation - state_.variance_nm2);
  state_.has_tare = 1;
  state_.tare_age_s = 0.0F;
  state_.snapshot_s += duration_s;
  if (state_.idle_s < kTareTime_s) {
    state_.snapshots_nm.fill(state_.tare_nm);
  } else if (state_.snapshot_s >= kSnapshot_s) {
    for (std::size_t k = 3; k > 0; --k) state_.snapshots_nm[k] = state_.snapshots_nm[k - 1];
    state_.snapshots_nm[0] = state_.tare_nm;
    state_.snapshot_s = 0.0F;
  }
}

auto AirCut::decide(const Input& input, float y_nm, float slope_nm, float sign) const noexcept
    -> Phase {
  const float rated = config_.rated_torque_nm;
  float threshold = config_.contact_ratio * rated;
  const float noise = 4.0F * input.sigma_nm;
  const float ripple = 4.0F * std::sqrt(state_.variance_nm2);
  const float scatter = ripple > noise && state_.has_tare != 0 ? ripple : noise;
  const float limit = kLargestThreshold_ratio * rated;
  if (scatter > threshold) threshold = scatter < limit ? scatter : limit;

  const float net = y_nm - state_.tare_nm;
  const float noisy = input.speed_sigma_rad_s < kNoisySpeed_rad_s
                          ? input.speed_sigma_rad_s / kNoisySpeed_rad_s
                          : 1.0F;
  const bool waited = state_.steady_s > kShortestWait_s + kNoiseWait_s * noisy;

  if (!input.calibrated) return Phase::kUnsteady;
  if (input.feed == Feed::kActive) return Phase::kCut;
  if (input.feed == Feed::kIdle) return waited ? Phase::kIdle : Phase::kUnsteady;

  switch (state_.phase) {
    case Phase::kIdle: {
      if (magnitude(net) <= threshold) return Phase::kIdle;
      if (state_.idle_s < kYoungTare_s) return Phase::kUnsteady;
      const bool speeding_up = slope_nm > kUnsteady_ratio * rated;
      const bool braking = input.airgap_torque_nm * sign < state_.tare_nm - threshold;
      return net > 0.0F && !speeding_up && !braking ? Phase::kCut : Phase::kUnsteady;
    }
    case Phase::kCut: {
      if (state_.has_tare == 0 && waited) break;  // as at the start: nothing to compare with
      if (!waited || !(magnitude(state_.slow_net_nm) <= threshold)) return Phase::kCut;
      return magnitude(net) <= threshold ? Phase::kIdle : Phase::kCut;
    }
    case Phase::kUnsteady:
      break;
  }
  if (!waited) return Phase::kUnsteady;
  if (state_.has_tare == 0) {
    // Not before the load torque is known well enough to be a tare.
    if (!(input.sigma_nm < kTareSigma_ratio * rated) && state_.even_s < kLongestWait_s) {
      return Phase::kUnsteady;
    }
    // No cut drives the spindle: less than nominal friction is friction or a wrong parameter.
    const float believed = config_.friction_limit_ratio * rated;
    const float most = believed + input.model_sigma_nm;
    return y_nm < most && y_nm > -most - believed ? Phase::kIdle : Phase::kCut;
  }
  return magnitude(net) < kReturn_ratio * rated && state_.was_cut == 0 ? Phase::kIdle : Phase::kCut;
}

auto AirCut::step(const Input& input) noexcept -> Output {
  const float h = input.duration_s;
  if (!input.valid) {
    state_.phase = Phase::kUnsteady;
    state_.steady_s = 0.0F;
    state_.even_s = 0.0F;
    state_.idle_s = 0.0F;
    state_.slow_speed_rad_s = input.speed_rad_s;
    state_.slower_speed_rad_s = input.speed_rad_s;
  }
  const float sign = input.speed_rad_s > 0.0F ? 1.0F : (input.speed_rad_s < 0.0F ? -1.0F : 0.0F);
  const float y = (input.load_torque_nm - config_.viscous_nm_s_rad * input.speed_rad_s) * sign -
                  config_.coulomb_torque_nm;  // (E90)
  const float share = h < kSlopeTime_s ? h / kSlopeTime_s : 1.0F;
  const float lag = input.speed_rad_s - state_.slow_speed_rad_s;
  const float slope_nm = config_.inertia_kg_m2 * lag / kSlopeTime_s * sign;
  state_.slow_speed_rad_s += share * lag;
  const float slow_lag = state_.slow_speed_rad_s - state_.slower_speed_rad_s;
  state_.slower_speed_rad_s += share * slow_lag;
  // Smoothed twice: channel offsets ripple at the electrical frequency until calibrated.
  const float trend_nm = config_.inertia_kg_m2 * slow_lag / kSlopeTime_s;
  state_.slow_net_nm += share * (y - state_.tare_nm - state_.slow_net_nm);

  if (input.valid) {
    const bool steady = magnitude(trend_nm) < kUnsteady_ratio * config_.rated_torque_nm;
    const bool in_band = state_.phase != Phase::kCut ||
                         magnitude(y - state_.tare_nm) < 0.1F * config_.rated_torque_nm;
    state_.even_s = steady ? state_.even_s + h : 0.0F;
    state_.steady_s = steady && in_band ? state_.steady_s + h : 0.0F;
    const Phase before = state_.phase;
    const Phase now = decide(input, y, slope_nm, sign);
    if (before == Phase::kIdle && now != Phase::kIdle) {
      if (state_.has_tare != 0) state_.tare_nm = state_.snapshots_nm[3];
      if (state_.idle_s < kYoungTare_s && now == Phase::kUnsteady) state_.has_tare = 0;
      state_.idle_s = 0.0F;
    }
    if (now == Phase::kCut) state_.was_cut = 1;
    // What has just changed has not been steady: its slope shows only some ticks later.
    if (now != before && now != Phase::kIdle) state_.steady_s = 0.0F;
    if (now == Phase::kIdle) {
      state_.was_cut = 0;
      if (before != Phase::kIdle && state_.has_tare != 0 && input.feed == Feed::kUnknown) {
        // Keep the old tare as the start of the average: it is already near.
        state_.idle_s = 0.1F;
        state_.tare_weight *= 0.3F;
      } else if (state_.has_tare == 0) {
        state_.tare_nm = y;
      }
      if (steady) tare(y, input.sigma_nm * input.sigma_nm, h);
    }
    state_.phase = now;
  }
  state_.tare_age_s += h;

  const float averaged_s = state_.idle_s > h ? state_.idle_s : h;
  const float samples = (averaged_s < kTareTime_s ? averaged_s : kTareTime_s) / h;
  const float aged_nm = kAging_ratio_sqrt_s * config_.rated_torque_nm;
  const float unknown_nm = kUnknownFriction_ratio * config_.rated_torque_nm;
  const float tare_variance_nm2 =
      state_.has_tare != 0 ? state_.variance_nm2 / samples + aged_nm * aged_nm * state_.tare_age_s
                           : unknown_nm * unknown_nm;
  return {.phase = state_.phase,
          .steady = state_.even_s > kEven_s,
          .net_torque_nm = (y - state_.tare_nm) * sign,
          .tare_nm = state_.tare_nm,
          .tare_sigma_nm = std::sqrt(tare_variance_nm2),
          .idle_variance_nm2 = state_.variance_nm2,
          .idle_s = state_.phase == Phase::kIdle ? state_.idle_s : 0.0F,
          .tare_age_s = state_.tare_age_s,
          .has_tare = state_.has_tare != 0};
}

}  // namespace cutforce::estimator
