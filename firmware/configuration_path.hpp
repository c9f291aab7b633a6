// What the torque path and its blocks are told.
#pragma once

#include <cstdint>

#include "estimator/torque_path.hpp"
#include "firmware/configuration_derived.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware::from_machine {

[[nodiscard]] constexpr estimator::IdleTare::Config idle_tare(const Machine& m,
                                                              float window_s) noexcept {
  const float rated = m.rated_torque_nm;
  return {.period_s = window_s,
          .coulomb_nm = m.coulomb_torque_nm,
          .viscous_nm_s_rad = m.viscous_nm_s_rad,
          .idle_sigma_nm = kIdleTorqueSigma * rated,
          .viscous_sigma_nm_s_rad =
              m.viscous_nm_s_rad > 0.0F ? m.viscous_nm_s_rad : 0.01F * rated / m.rated_speed_rad_s,
          .inertia_sigma_ratio = m.inertia_sigma_ratio,
          .band_least_nm = 0.003F * rated,
          .band_most_nm = 0.015F * rated,
          .wait_s = 4.0F * window_s,
          .memory_s = 0.3F,
          .drift_nm_s = 0.002F * rated,
          .aging_nm_sqrt_s = 0.0005F * rated,
          .steady_rad_s = 0.002F * m.rated_speed_rad_s,
          .speed_spread_rad_s = 0.06F * m.rated_speed_rad_s,
          .forgetting_ratio = 0.9F,
          .minimum_speed_rad_s = m.minimum_speed_rad_s};
}

[[nodiscard]] constexpr estimator::TorquePath::Method method(EstimatorName name) noexcept {
  switch (name) {
    case EstimatorName::kMeasured:
      return estimator::TorquePath::Method::kMeasured;
    case EstimatorName::kComputed:
      return estimator::TorquePath::Method::kComputed;
    case EstimatorName::kSynthesized:
    case EstimatorName::kFused:
    case EstimatorName::kDynamometer:
      break;
  }
  return estimator::TorquePath::Method::kSynthesized;
}

[[nodiscard]] constexpr estimator::TorquePath::Speed path_speed(SpeedSource source) noexcept {
  switch (source) {
    case SpeedSource::kSynchronous:
      return estimator::TorquePath::Speed::kSynchronous;
    case SpeedSource::kSlip:
      return estimator::TorquePath::Speed::kSlip;
    case SpeedSource::kRotor:
      break;
  }
  return estimator::TorquePath::Speed::kRotor;
}

[[nodiscard]] constexpr estimator::TorquePath::Config torque_path(const Machine& m,
                                                                  const Derived& d) noexcept {
  const std::uint32_t samples = d.samples_per_estimate * d.estimates_per_control;
  const float window_s = d.sample_period_s * static_cast<float>(samples);
  const auto& speeds = m.load_friction_speed_rad_s;
  const float slip = 1.0F - m.rated_speed_rad_s * m.pole_pairs / d.rated_frequency_rad_s;
  return {
      .method = method(m.estimator),
      .speed = path_speed(m.speed_source),
      .power = {.sample_period_s = d.sample_period_s,
                .samples_per_window = samples,
                .stator_resistance_ohm = d.resistance_ohm,
                .mode = m.power_mode == PowerMode::kFixedPowerFactor
                            ? estimator::AirGapPower::Mode::kFixedPowerFactor
                            : estimator::AirGapPower::Mode::kDotProduct,
                .power_factor_ratio = m.fixed_power_factor_ratio,
                .window = estimator::AirGapPower::Window::kTime},
      .synchronous = {.sample_period_s = d.sample_period_s,
                      .samples_per_window = samples,
                      .vector = estimator::SynchronousSpeed::Vector::kFlux,
                      .pole_pairs = m.pole_pairs,
                      .stator_resistance_ohm = d.resistance_ohm,
                      .leakage_inductance_h = m.leakage_inductance_h,
                      .flux_leak_rad_s = 10.0F,
                      .minimum_current_a = 0.02F * m.rated_current_a_rms,
                      .minimum_electrical_rad_s = 0.06F * d.rated_frequency_rad_s},
      .meter = {.period_s = window_s,
                .scale_ratio = m.meter_scale_ratio,
                .offset_w = m.meter_offset_w,
                .efficiency_ratio = m.meter_efficiency_ratio,
                .loss_w = {.speed_rad_s = speeds, .value = {0.0F, 0.0F, 0.0F}},
                .loss_quadratic_1_w = 0.0F,
                .lag_s = m.meter_lag_s,
                .noise_w = m.meter_noise_w,
                .model_sigma_ratio = 0.02F,
                .bias_memory_s = 0.15F,
                .settled_w = 0.036F * m.rated_power_w},
      .drive = {.period_s = window_s, .inertia_kg_m2 = m.inertia_kg_m2},
      .load_friction = {.linear_ratio = {.speed_rad_s = speeds, .value = m.load_friction_ratio},
                        .quadratic_1_nm = {.speed_rad_s = speeds, .value = m.load_friction_1_nm}},
      .tare = idle_tare(m, window_s),
      .monitor = {.period_s = window_s,
                  .mode = m.switch_mode == SwitchMode::kPositiveOnly
                              ? estimator::SynthesizedMonitor::Mode::kPositiveOnly
                              : estimator::SynthesizedMonitor::Mode::kAbsolute,
                  .threshold_ratio = m.switch_threshold_ratio,
                  .hold_s = m.switch_hold_s,
                  .compensation_ratio = m.switch_compensation_ratio,
                  .power_floor_w = m.power_floor_w},
      .rotor_resistance_ohm = m.rotor_resistance_ohm,
      .rated_torque_nm = m.rated_torque_nm,
      .rated_slip_ratio = slip > 0.0F ? slip : 0.0F,
      .stator_resistance_sigma_ratio = m.stator_resistance_sigma_ratio,
      .inertia_sigma_ratio = m.inertia_sigma_ratio,
      .speed_sigma_rad_s = 0.01F,
      .minimum_speed_rad_s = m.minimum_speed_rad_s};
}

}  // namespace cutforce::firmware::from_machine
