// From the samples of a window to its means, its speeds, and torques with their uncertainty.
#include <algorithm>

#include "estimator/torque_path_parts.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kSmallestFluxV2s2 = 1e-6F;  // only keeps a division finite

}  // namespace

auto TorquePath::window(const AirGapPower::Output& power,
                        const SynchronousSpeed::Output& synchronous) noexcept -> Window {
  const std::uint32_t samples = config_.power.samples_per_window;
  Window means{};
  means.has_airgap_power = sums_.motor_samples == samples;
  means.airgap_power_w = power.airgap_power_w;
  means.current_square_a2 = power.current_square_a2;
  means.noise_variance_w2 = power.noise_variance_w2;
  find_speeds(synchronous, means);
  // A meter is slow: some readings of the window will do.
  means.has_measured_power = 2 * sums_.meter_samples >= samples;
  if (means.has_measured_power) {
    const auto measured =
        blocks_.meter.step({.meter_w = sums_.meter_w / static_cast<float>(sums_.meter_samples),
                            .speed_rad_s = means.speed_rad_s});
    means.measured_power_w = measured.power_w;
    means.measured_sigma_w = measured.sigma_w;
  }
  return means;
}

void TorquePath::find_speeds(const SynchronousSpeed::Output& synchronous,
                             Window& window) const noexcept {
  const float count = static_cast<float>(config_.power.samples_per_window);
  const bool has_sensor = sums_.speed_samples == config_.power.samples_per_window;
  const bool has_rotation = window.has_airgap_power && synchronous.valid;
  window.has_speed = has_sensor || has_rotation;
  window.has_sensor = has_sensor;
  const float flux_square = std::max(synchronous.flux_square_v2s2, kSmallestFluxV2s2);
  float mean = sums_.speed_rad_s / count;
  float end = sums_.last_speed_rad_s;
  float divide = mean;
  if (!has_sensor && has_rotation) {
    // (E29) the other way round.
    const float slip = config_.rotor_resistance_ohm * window.airgap_power_w /
                       (1.5F * config_.synchronous.pole_pairs * config_.synchronous.pole_pairs *
                        flux_square * synchronous.synchronous_rad_s);
    mean = synchronous.synchronous_rad_s - slip;
    end = synchronous.synchronous_end_rad_s - slip;
    divide = synchronous.synchronous_rad_s;
  } else if (has_rotation && config_.speed == Speed::kSynchronous) {
    divide = synchronous.synchronous_rad_s;
  } else if (has_rotation && config_.speed == Speed::kSlip) {
    divide = synchronous_speed_from_slip(mean, window.airgap_power_w, config_.rotor_resistance_ohm,
                                         config_.synchronous.pole_pairs, flux_square);
  }
  window.direction = mean < 0.0F ? -1.0F : 1.0F;
  window.speed_rad_s = window.has_speed ? window.direction * mean : 0.0F;
  window.end_speed_rad_s = window.direction * end;
  window.power_speed_rad_s = window.direction * divide;
}

// P3 (1) or (4), by the speed that find_speeds chose.
auto TorquePath::computed(const Window& window) const noexcept -> Estimate {
  const float speed = std::max(window.power_speed_rad_s, config_.minimum_speed_rad_s);
  const float loss = 1.5F * config_.power.stator_resistance_ohm *
                     config_.stator_resistance_sigma_ratio *
                     (window.current_square_a2 - sums_.idle_current_square_a2);
  return {.airgap_torque_nm = window.airgap_power_w / speed,
          .cutting_torque_nm = 0.0F,
          .sensitivity_ratio = 0.0F,
          .noise_variance_nm2 = window.noise_variance_w2 / (speed * speed),
          .model_variance_nm2 = loss * loss / (speed * speed)};
}

auto TorquePath::measured(const Window& window) const noexcept -> Estimate {
  const float speed = std::max(window.power_speed_rad_s, config_.minimum_speed_rad_s);
  const float sigma = window.measured_sigma_w / speed;
  return {.airgap_torque_nm = window.measured_power_w / speed,
          .cutting_torque_nm = 0.0F,
          .sensitivity_ratio = 0.0F,
          .noise_variance_nm2 = 0.0F,
          .model_variance_nm2 = sigma * sigma};
}

// Of the torque above idle: (E48) without its last term.
auto TorquePath::torque_variance(const Window& window, const Load& load,
                                 const Estimate& estimate) const noexcept -> float {
  const float speed_nm = blocks_.drive.gain(0.0F) * config_.speed_sigma_rad_s;
  const float seen = load.tare.noise_sigma_nm * load.tare.noise_sigma_nm;
  const float noise = std::max(estimate.noise_variance_nm2 + 2.0F * speed_nm * speed_nm, seen);
  const float inertia_nm = config_.inertia_sigma_ratio * load.inertia_torque_nm;
  // P3 (4) overstates the torque by the slip, which grows with the torque itself.
  const bool slip_left_out = config_.speed == Speed::kRotor && window.has_sensor;
  const float slip_nm = slip_left_out ? config_.rated_slip_ratio * estimate.airgap_torque_nm *
                                            estimate.airgap_torque_nm / config_.rated_torque_nm
                                      : 0.0F;
  return noise + estimate.model_variance_nm2 + inertia_nm * inertia_nm + slip_nm * slip_nm +
         load.tare.sigma_nm * load.tare.sigma_nm;
}

}  // namespace cutforce::estimator
