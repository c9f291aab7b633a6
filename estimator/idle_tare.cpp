#include "estimator/idle_tare_step.hpp"

#include <algorithm>
#include <cmath>

namespace cutforce::estimator {
namespace {

constexpr float kBandSigmas = 5.0F;
constexpr float kNoiseGain = 0.1F;         // per window, of the variance seen in idle
constexpr float kResidualVariance = 1.2F;  // of the torque, per variance left around its own mean

}  // namespace

void IdleTare::note_noise() noexcept {
  if (state_.acquired == 0) {
    noise_sigma_nm_ = 0.0F;
    band_nm_ = config_.band_most_nm;
    return;
  }
  noise_sigma_nm_ = std::sqrt(state_.noise_variance_nm2);
  band_nm_ = std::clamp(kBandSigmas * noise_sigma_nm_, config_.band_least_nm, config_.band_most_nm);
}

auto IdleTare::step(const Input& input) noexcept -> Output { return step_inlined(input); }

// How far from the expected idle torque a torque at rest may be and still be idle.
auto IdleTare::reach(float speed_rad_s) const noexcept -> float {
  const float first = band_nm_ + 2.0F * config_.idle_sigma_nm;
  if (state_.acquired == 0) return first;
  const float moved = std::abs(speed_rad_s - state_.tare_speed_rad_s);
  const float aged = band_nm_ + 2.0F * config_.aging_nm_sqrt_s * std::sqrt(state_.age_s) +
                     2.0F * config_.viscous_sigma_nm_s_rad * moved;
  return std::min(first, aged);
}

// Whether the torque rises above the idle torque, at once or slowly.
auto IdleTare::touches(Input input) const noexcept -> bool {
  const float idle = idle_torque(input.speed_rad_s);
  const float allowed = reach(input.speed_rad_s) +
                        2.0F * config_.inertia_sigma_ratio * std::abs(input.inertia_torque_nm);
  if (input.load_torque_nm - idle > allowed) return true;
  return state_.acquired != 0 && state_.recent >= 4 &&
         recent_mean() - idle > allowed - 0.5F * band_nm_;
}

void IdleTare::stand_still() noexcept {
  close_idle();
  state_.mode = Mode::kSearching;
  state_.speed_rad_s = 0.0F;
  state_.rest_windows = 0;
  state_.steady_windows = 0;
  state_.recent = 0;
}

void IdleTare::tare(Input input) noexcept {
  const float oldest = state_.recent_nm[state_.recent % 4];
  const float idle = idle_torque(input.speed_rad_s);
  const float rest_above = state_.rest_torque_nm - idle;
  const bool elsewhere =
      std::abs(input.speed_rad_s - state_.tare_speed_rad_s) > config_.speed_spread_rad_s;
  if (state_.acquired == 0 || elsewhere || std::abs(rest_above) > reach(input.speed_rad_s)) {
    state_.coulomb_nm += rest_above;
  } else {
    const float limit = config_.drift_nm_s * config_.period_s;
    state_.coulomb_nm += std::clamp(gain_ * (oldest - idle), -limit, limit);  // (E45)
  }
  const float residual = input.load_torque_nm - state_.rest_torque_nm;
  state_.noise_variance_nm2 +=
      kNoiseGain * (kResidualVariance * residual * residual - state_.noise_variance_nm2);
  state_.tare_speed_rad_s = input.speed_rad_s;
  state_.age_s = 0.0F;
  state_.acquired = 1;
  note_noise();

  ++state_.idle_windows;
  const float count = static_cast<float>(state_.idle_windows);
  state_.idle_torque_nm += (oldest - state_.idle_torque_nm) / count;
  state_.idle_speed_rad_s += (input.speed_rad_s - state_.idle_speed_rad_s) / count;
}

void IdleTare::close_idle() noexcept {
  if (state_.idle_windows >= wait_windows_) regress();
  state_.idle_windows = 0;
  state_.idle_torque_nm = 0.0F;
  state_.idle_speed_rad_s = 0.0F;
}

// (E47): one idle is one point. The line is turned about the idle just left, so that the tare
// there stays what it is.
void IdleTare::regress() noexcept {
  const float keep = config_.forgetting_ratio;
  const float speed = state_.idle_speed_rad_s - state_.mean_speed_rad_s;
  const float torque = state_.idle_torque_nm - state_.mean_torque_nm;
  state_.weight = keep * state_.weight + 1.0F;
  state_.mean_speed_rad_s += speed / state_.weight;
  state_.mean_torque_nm += torque / state_.weight;
  state_.speed_speed =
      keep * state_.speed_speed + speed * (state_.idle_speed_rad_s - state_.mean_speed_rad_s);
  state_.speed_torque =
      keep * state_.speed_torque + speed * (state_.idle_torque_nm - state_.mean_torque_nm);

  const float half_spread = 0.5F * config_.speed_spread_rad_s;
  if (!(state_.speed_speed >= 0.8F * half_spread * half_spread * state_.weight)) return;
  const float most = config_.viscous_nm_s_rad + 5.0F * config_.viscous_sigma_nm_s_rad;
  const float viscous = std::clamp(state_.speed_torque / state_.speed_speed, 0.0F, most);
  state_.coulomb_nm += (state_.viscous_nm_s_rad - viscous) * state_.idle_speed_rad_s;
  state_.viscous_nm_s_rad = viscous;
}

}  // namespace cutforce::estimator
