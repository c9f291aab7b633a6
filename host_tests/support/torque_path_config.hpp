// The motor of the simulated recordings (2.2 kW, 1500 rpm) and P3's constants, as a configuration
// of the whole path. Tests change single fields of it.
#pragma once

#include "estimator/torque_path.hpp"

namespace cutforce::host_tests {

[[nodiscard]] constexpr estimator::IdleTare::Config small_motor_tare() {
  constexpr float kRatedNm = 14.6F;
  return {.period_s = 0.05F,
          .coulomb_nm = 0.4F,
          .viscous_nm_s_rad = 0.002F,
          .idle_sigma_nm = 0.03F * kRatedNm,
          .viscous_sigma_nm_s_rad = 0.002F,
          .inertia_sigma_ratio = 0.05F,
          .band_least_nm = 0.003F * kRatedNm,
          .band_most_nm = 0.015F * kRatedNm,
          .wait_s = 0.2F,
          .memory_s = 0.3F,
          .drift_nm_s = 0.002F * kRatedNm,
          .aging_nm_sqrt_s = 0.0005F * kRatedNm,
          .steady_rad_s = 0.3F,
          .speed_spread_rad_s = 10.0F,
          .forgetting_ratio = 0.9F,
          .minimum_speed_rad_s = 5.0F};
}

[[nodiscard]] constexpr estimator::TorquePath::Config small_motor_path(
    estimator::TorquePath::Method method, float sample_rate_hz) {
  constexpr float kNone = 0.0F;
  const float sample_period_s = 1.0F / sample_rate_hz;
  const auto samples = static_cast<std::uint32_t>(0.05F * sample_rate_hz + 0.5F);
  const std::array<float, 3> speeds{0.0F, 100.0F, 300.0F};
  return {
      .method = method,
      .speed = estimator::TorquePath::Speed::kRotor,
      .power = {.sample_period_s = sample_period_s,
                .samples_per_window = samples,
                .stator_resistance_ohm = 3.7F,
                .mode = estimator::AirGapPower::Mode::kDotProduct,
                .power_factor_ratio = 0.8660254F,
                .window = estimator::AirGapPower::Window::kTime},
      .synchronous = {.sample_period_s = sample_period_s,
                      .samples_per_window = samples,
                      .vector = estimator::SynchronousSpeed::Vector::kFlux,
                      .pole_pairs = 2.0F,
                      .stator_resistance_ohm = 3.7F,
                      .leakage_inductance_h = 0.021F,
                      .flux_leak_rad_s = 10.0F,
                      .minimum_current_a = 0.1F,
                      .minimum_electrical_rad_s = 20.0F},
      .meter = {.period_s = 0.05F,
                .scale_ratio = 1.0F,
                .offset_w = kNone,
                .efficiency_ratio = 1.0F,
                .loss_w = {.speed_rad_s = speeds, .value = {kNone, kNone, kNone}},
                .loss_quadratic_1_w = kNone,
                .lag_s = 0.3F,
                .noise_w = 1.0F,
                .model_sigma_ratio = 0.02F,
                .bias_memory_s = 0.15F,
                .settled_w = 80.0F},
      .drive = {.period_s = 0.05F, .inertia_kg_m2 = 0.03F},
      .load_friction = {.linear_ratio = {.speed_rad_s = speeds, .value = {0.05F, 0.05F, 0.05F}},
                        .quadratic_1_nm = {.speed_rad_s = speeds, .value = {kNone, kNone, kNone}}},
      .tare = small_motor_tare(),
      .monitor = {.period_s = 0.05F,
                  .mode = estimator::SynthesizedMonitor::Mode::kAbsolute,
                  .threshold_ratio = 0.08F,
                  .hold_s = 0.2F,
                  .compensation_ratio = 0.97F,
                  .power_floor_w = 100.0F},
      .rotor_resistance_ohm = 2.1F,
      .rated_torque_nm = 14.6F,
      .rated_slip_ratio = 0.05F,
      .stator_resistance_sigma_ratio = 0.05F,
      .inertia_sigma_ratio = 0.05F,
      .speed_sigma_rad_s = 0.01F,
      .minimum_speed_rad_s = 5.0F};
}

}  // namespace cutforce::host_tests
