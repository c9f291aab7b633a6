#include "estimator/idle_tare.hpp"

#include <algorithm>
#include <cmath>

namespace cutforce::estimator {
namespace {

constexpr float kBandSigmas = 5.0F;
constexpr float kRestMemory = 8.0F;        // windows in the mean of the torque at rest
constexpr float kNoiseGain = 0.1F;         // per window, of the variance seen in idle
constexpr float kResidualVariance = 1.2F;  // of the torque, per variance left around its own mean

}  // namespace

IdleTare::IdleTare(const Config& config) noexcept
    : config_(config),
      wait_windows_(static_cast<std::uint32_t>(config.wait_s / config.period_s + 0.5F)),
      gain_(config.period_s / (config.period_s + config.memory_s)) {
  state_.coulomb_nm = config.coulomb_nm;
  state_.viscous_nm_s_rad = config.viscous_nm_s_rad;
  // Until idle was seen, the band is at its upper limit.
  state_.noise_variance_nm2 = config.band_most_nm * config.band_most_nm / 25.0F;
  note_noise();
}

void IdleTare::note_noise() noexcept {
  noise_sigma_nm_ = std::sqrt(state_.noise_variance_nm2);
  band_nm_ = std::clamp(kBandSigmas * noise_sigma_nm_, config_.band_least_nm, config_.band_most_nm);
}

auto IdleTare::step(const Input& input) noexcept -> Output {
  state_.age_s += config_.period_s;
  if (!input.valid) {
    state_.rest_windows = 0;
    state_.recent = 0;
    return publish(input, false);
  }
  if (!(input.speed_rad_s >= config_.minimum_speed_rad_s)) {
    stand_still();
    return publish(input, false);
  }
  rest(input);
  decide(input);
  const bool taring = state_.mode == Mode::kIdle && state_.rest_windows >= wait_windows_;
  if (taring) {
    tare(input);
  } else {
    close_idle();
  }
  return publish(input, taring);
}

// How far from the expected idle torque a torque at rest may be and still be idle.
auto IdleTare::reach(const Input& input) const noexcept -> float {
  const float first = band_nm_ + 2.0F * config_.idle_sigma_nm;
  if (state_.acquired == 0) return first;
  const float moved = std::abs(input.speed_rad_s - state_.tare_speed_rad_s);
  const float aged = band_nm_ + 2.0F * config_.aging_nm_sqrt_s * std::sqrt(state_.age_s) +
                     2.0F * config_.viscous_sigma_nm_s_rad * moved;
  return std::min(first, aged);
}

auto IdleTare::recent_mean() const noexcept -> float {
  return 0.25F * ((state_.recent_nm[0] + state_.recent_nm[1]) +
                  (state_.recent_nm[2] + state_.recent_nm[3]));
}

// Keeps the account of how long speed and torque have been at rest.
void IdleTare::rest(const Input& input) noexcept {
  const bool steady = std::abs(input.speed_rad_s - state_.speed_rad_s) <= config_.steady_rad_s;
  state_.speed_rad_s = input.speed_rad_s;
  state_.steady_windows = steady ? state_.steady_windows + 1 : 0;
  const float torque = input.load_torque_nm;
  if (!steady || state_.recent == 0 || !(std::abs(torque - state_.rest_torque_nm) <= band_nm_)) {
    state_.rest_windows = 0;
    state_.recent = 0;
    state_.rest_torque_nm = torque;
  } else {
    ++state_.rest_windows;
    const float count = std::min(static_cast<float>(state_.rest_windows) + 1.0F, kRestMemory);
    state_.rest_torque_nm += (torque - state_.rest_torque_nm) / count;
  }
  state_.recent_nm[state_.recent % 4] = torque;
  ++state_.recent;
}

void IdleTare::decide(const Input& input) noexcept {
  switch (input.feed) {
    case Feed::kAir:
      state_.mode = Mode::kIdle;
      return;
    case Feed::kCut:
      if (state_.mode != Mode::kCut) enter_cut(0.0F);
      return;
    case Feed::kUnknown:
      decide_alone(input);
      return;
  }
}

// Whether the torque rises above the idle torque, at once or slowly.
auto IdleTare::touches(const Input& input) const noexcept -> bool {
  const float idle = idle_torque(input.speed_rad_s);
  const float allowed =
      reach(input) + 2.0F * config_.inertia_sigma_ratio * std::abs(input.inertia_torque_nm);
  if (input.load_torque_nm - idle > allowed) return true;
  return state_.acquired != 0 && state_.recent >= 4 &&
         recent_mean() - idle > allowed - 0.5F * band_nm_;
}

void IdleTare::decide_alone(const Input& input) noexcept {
  const float idle = idle_torque(input.speed_rad_s);
  const float above = state_.recent >= 4 ? recent_mean() - idle : input.load_torque_nm - idle;
  const bool resting = state_.rest_windows >= wait_windows_;
  const float rest_above = state_.rest_torque_nm - idle;
  switch (state_.mode) {
    case Mode::kSearching:
      if (resting && rest_above <= reach(input)) {
        state_.mode = Mode::kIdle;
      } else if (state_.steady_windows >= wait_windows_ && touches(input)) {
        enter_cut(above);
      }
      return;
    case Mode::kIdle:
      if (touches(input)) enter_cut(input.load_torque_nm - idle);
      return;
    case Mode::kCut:
      state_.highest_nm = std::max(state_.highest_nm, above);
      if (resting && rest_above <= std::min(reach(input), 0.5F * state_.highest_nm)) {
        state_.mode = Mode::kIdle;
      }
      return;
  }
}

void IdleTare::enter_cut(float above_idle_nm) noexcept {
  state_.mode = Mode::kCut;
  state_.highest_nm = above_idle_nm;
}

void IdleTare::stand_still() noexcept {
  close_idle();
  state_.mode = Mode::kSearching;
  state_.speed_rad_s = 0.0F;
  state_.rest_windows = 0;
  state_.steady_windows = 0;
  state_.recent = 0;
}

void IdleTare::tare(const Input& input) noexcept {
  const float oldest = state_.recent_nm[state_.recent % 4];
  const float idle = idle_torque(input.speed_rad_s);
  const float rest_above = state_.rest_torque_nm - idle;
  const bool elsewhere =
      std::abs(input.speed_rad_s - state_.tare_speed_rad_s) > config_.speed_spread_rad_s;
  if (state_.acquired == 0 || elsewhere || std::abs(rest_above) > reach(input)) {
    state_.coulomb_nm += rest_above;
  } else {
    const float limit = config_.drift_nm_s * config_.period_s;
    state_.coulomb_nm += std::clamp(gain_ * (oldest - idle), -limit, limit);  // (E45)
  }
  const float residual = input.load_torque_nm - state_.rest_torque_nm;
  state_.noise_variance_nm2 +=
      kNoiseGain * (kResidualVariance * residual * residual - state_.noise_variance_nm2);
  note_noise();
  state_.tare_speed_rad_s = input.speed_rad_s;
  state_.age_s = 0.0F;
  state_.acquired = 1;

  ++state_.idle_windows;
  const float count = static_cast<float>(state_.idle_windows);
  state_.idle_torque_nm += (oldest - state_.idle_torque_nm) / count;
  state_.idle_speed_rad_s += (input.speed_rad_s - state_.idle_speed_rad_s) / count;
}

void IdleTare::close_idle() noexcept {
  if (state_.idle_windows == 0) return;
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

auto IdleTare::publish(const Input& input, bool taring) const noexcept -> Output {
  const bool acquired = state_.acquired != 0;
  const float moved =
      config_.viscous_sigma_nm_s_rad * (input.speed_rad_s - state_.tare_speed_rad_s);
  const float variance = state_.noise_variance_nm2 * gain_ +
                         config_.aging_nm_sqrt_s * config_.aging_nm_sqrt_s * state_.age_s +
                         moved * moved;  // (E46)
  return {.coulomb_nm = state_.coulomb_nm,
          .viscous_nm_s_rad = state_.viscous_nm_s_rad,
          .idle_torque_nm = idle_torque(input.speed_rad_s),
          .sigma_nm = acquired ? std::sqrt(variance) : config_.idle_sigma_nm,
          .noise_sigma_nm = acquired ? noise_sigma_nm_ : 0.0F,
          .age_s = state_.age_s,
          .in_cut = state_.mode == Mode::kCut,
          .taring = taring,
          .acquired = acquired};
}

}  // namespace cutforce::estimator
