#include "estimator/air_cut.hpp"

#include <cmath>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kSnapshot_s = 0.025F;
constexpr float kNoiseWait_s = 0.15F;
constexpr float kNoisySpeed_rad_s = 0.2F;
constexpr float kTorqueFloor_ratio = 1e-3F;
constexpr float kTareSigma_ratio = 0.02F;
constexpr float kSettled_s = 0.5F;
constexpr float kDrift_ratio_s = 0.004F;
constexpr float kLongestWait_s = 1.2F;
constexpr float kYoungTare_s = 0.06F;
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

// What the tick before has found no longer holds.
void AirCut::lose(float speed_rad_s) noexcept {
  state_.phase = Phase::kUnsteady;
  state_.steady_s = 0.0F;
  state_.even_s = 0.0F;
  state_.idle_s = 0.0F;
  state_.slow_speed_rad_s = speed_rad_s;
  state_.slower_speed_rad_s = speed_rad_s;
}

void AirCut::change(Phase now, float y_nm, Feed feed) noexcept {
  if (state_.phase == Phase::kIdle) {
    if (state_.has_tare != 0) state_.tare_nm = state_.snapshots_nm[3];
    if (state_.idle_s < kYoungTare_s && now == Phase::kUnsteady) state_.has_tare = 0;
    state_.idle_s = 0.0F;
  }
  if (now == Phase::kCut) state_.was_cut = 1;
  state_.phase = now;
  if (now != Phase::kIdle) {
    // What has just changed has not been steady: its slope shows only some ticks later.
    state_.steady_s = 0.0F;
    return;
  }
  state_.was_cut = 0;
  if (state_.has_tare == 0) {
    state_.tare_nm = y_nm;
  } else if (feed == Feed::kUnknown) {
    // Keep the old tare as the start of the average: it is already near.
    state_.idle_s = 0.1F;
    state_.tare_weight *= 0.3F;
  }
}

auto AirCut::decide(const Input& input, float y_nm, float lag_rad_s, float sign) const noexcept
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
      const float slope_nm = config_.inertia_kg_m2 * lag_rad_s / kSlopeTime_s * sign;
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

}  // namespace cutforce::estimator
