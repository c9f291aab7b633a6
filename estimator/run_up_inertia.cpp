#include "estimator/run_up_inertia.hpp"

#include <cmath>

namespace cutforce::estimator {
namespace {

constexpr float kTorqueError_ratio = 0.01F;          // of the run-up's torque: resistance, offsets
constexpr float kTareError_ratio = 0.002F;           // of rated: friction differs while speeding up
constexpr float kSmallestAcceleration_ratio = 0.1F;  // of rated, mean over the run-up
constexpr float kFarthest_sigmas = 2.0F;

}  // namespace

RunUpInertia::RunUpInertia(const Config& config) noexcept : config_(config) {
  state_.inertia_kg_m2 = config.inertia_kg_m2;
  state_.sigma_ratio = config.inertia_sigma_ratio;
}

auto RunUpInertia::make(const Config& config) noexcept -> std::expected<RunUpInertia, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return RunUpInertia{config};
}

void RunUpInertia::step(const Input& in) noexcept {
  State& s = state_;
  if (s.closed != 0) return;
  if (!in.valid) {
    s.seen = 0;
    s.impulse_nm_s = s.gained_rad_s = s.time_s = 0.0F;
    return;
  }
  if (in.tared) {
    close(in.tare_nm);
    s.closed = 1;
    return;
  }
  if (s.seen != 0) {
    const float sign = in.speed_rad_s < 0.0F ? -1.0F : 1.0F;
    const float friction =
        config_.coulomb_torque_nm * sign + config_.viscous_nm_s_rad * in.speed_rad_s;
    s.impulse_nm_s += (in.torque_nm - friction) * in.duration_s;
    s.gained_rad_s += in.speed_rad_s - s.last_speed_rad_s;
    s.time_s += in.duration_s;
  }
  s.seen = 1;
  s.last_speed_rad_s = in.speed_rad_s;
}

void RunUpInertia::close(float tare_nm) noexcept {
  State& s = state_;
  const float gained = s.gained_rad_s < 0.0F ? -s.gained_rad_s : s.gained_rad_s;
  const float smallest =
      kSmallestAcceleration_ratio * config_.rated_torque_nm * s.time_s / config_.inertia_kg_m2;
  if (!(gained > smallest && gained > 0.0F && s.time_s > 0.0F)) return;
  const float seen = (s.impulse_nm_s - tare_nm * s.time_s) / s.gained_rad_s;  // (E115)
  const float from_tare = kTareError_ratio * config_.rated_torque_nm * s.time_s / gained;
  const float sigma =
      std::sqrt(kTorqueError_ratio * seen * kTorqueError_ratio * seen + from_tare * from_tare);
  const float prior = config_.inertia_sigma_ratio * config_.inertia_kg_m2;
  const float off = seen - config_.inertia_kg_m2;
  if (!(off < kFarthest_sigmas * prior && off > -kFarthest_sigmas * prior)) return;
  const float gain = prior * prior / (prior * prior + sigma * sigma);
  s.inertia_kg_m2 = config_.inertia_kg_m2 + gain * off;
  s.sigma_ratio = std::sqrt(1.0F - gain) * config_.inertia_sigma_ratio;
}

}  // namespace cutforce::estimator
