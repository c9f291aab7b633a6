// What the gate, the front end and the fused observer are told.
#pragma once

#include <cstdint>

#include "estimator/front_end.hpp"
#include "estimator/fused_observer.hpp"
#include "estimator/sample_gate.hpp"
#include "estimator/signal_health.hpp"
#include "firmware/configuration_derived.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware::from_machine {

[[nodiscard]] constexpr estimator::FrontEnd::Config front_end(const Machine& m) noexcept {
  return {.voltages = m.voltage_kind == VoltageKind::kLineToLine
                          ? estimator::VoltageChannels::kLineToLine
                          : estimator::VoltageChannels::kLineToNeutral,
          .currents = m.current_w_present ? estimator::CurrentChannels::kThree
                                          : estimator::CurrentChannels::kTwo,
          .calibration = {.voltage_gain_ratio = m.voltage_gain_ratio,
                          .voltage_offset_v = m.voltage_offset_v,
                          .current_gain_ratio = m.current_gain_ratio,
                          .current_offset_a = m.current_offset_a}};
}

[[nodiscard]] constexpr estimator::SampleGate::Config gate(const Machine& m,
                                                           const Derived& d) noexcept {
  const float shortest_gap_s = 2.5F * d.sample_period_s;
  const float gap_s = m.gap_limit_s < 2.0F ? m.gap_limit_s : 2.0F;
  return {.sample_period_s = d.sample_period_s,
          .voltage_limit_v = m.voltage_limit_v,
          .current_limit_a = m.current_limit_a,
          .speed_limit_rad_s = m.speed_limit_rad_s,
          .power_limit_w = m.power_limit_w,
          .gap_limit_s = gap_s > shortest_gap_s ? gap_s : shortest_gap_s,
          .bridge_limit = 2,
          .clock_limit = 100};
}

[[nodiscard]] constexpr estimator::SignalHealth::Config health(const Machine& m,
                                                               const Derived& d) noexcept {
  return {.sample_period_s = d.sample_period_s,
          .tick_period_s = d.sample_period_s * static_cast<float>(d.samples_per_estimate),
          .voltage_channels = 3,
          .current_channels = m.current_w_present ? 3U : 2U,
          .voltage_range_v = m.voltage_limit_v,
          .current_range_a = m.current_limit_a,
          .voltage_floor_v = 0.01F * m.rated_voltage_v_rms,
          .current_floor_a = 0.05F * m.rated_current_a_rms,
          .minimum_frequency_rad_s = 0.06F * d.rated_frequency_rad_s,
          .rated_frequency_rad_s = d.rated_frequency_rad_s,
          .rated_flux_v_s = d.flux_v_s,
          .stator_resistance_ohm = d.resistance_ohm,
          .hold_s = 0.5F};
}

[[nodiscard]] constexpr estimator::FusedObserver::Config fused(const Machine& m,
                                                               const Derived& d) noexcept {
  const float tick_s = d.sample_period_s * static_cast<float>(d.samples_per_estimate);
  const float iron_nm = m.iron_loss_w * m.pole_pairs / d.rated_frequency_rad_s;
  const float iron_sigma = m.iron_loss_declared ? kDeclaredIronTorqueSigma : kIronTorqueSigma;
  const float delay = m.speed_lag_s / tick_s + 0.5F;
  const bool sensorless = !m.speed_present;
  return {.flux = {.sample_period_s = d.sample_period_s,
                   .pole_pairs = m.pole_pairs,
                   .stator_resistance_ohm = d.resistance_ohm,
                   .leak_ratio = 0.2F},
          .filter = {.tick_s = tick_s,
                     .rated_torque_nm = m.rated_torque_nm,
                     // The flux angle's noise is larger and slower than a sensor's.
                     .edge_slope_1_s = (sensorless ? 0.75F : 1.0F) * m.edge_slope_1_s,
                     .drift_1_sqrt_s = m.drift_1_sqrt_s},
          .air = {.rated_torque_nm = m.rated_torque_nm,
                  .inertia_kg_m2 = m.inertia_kg_m2,
                  .coulomb_torque_nm = m.coulomb_torque_nm,
                  .viscous_nm_s_rad = m.viscous_nm_s_rad,
                  .contact_ratio = 0.015F,
                  .friction_limit_ratio = 0.15F},
          .inertia = {.inertia_kg_m2 = m.inertia_kg_m2,
                      .inertia_sigma_ratio = d.inertia_sigma_ratio,
                      .coulomb_torque_nm = m.coulomb_torque_nm,
                      .viscous_nm_s_rad = m.viscous_nm_s_rad,
                      .rated_torque_nm = m.rated_torque_nm,
                      .rated_speed_rad_s = d.rated_frequency_rad_s / m.pole_pairs},
          .resistance = {.pole_pairs = m.pole_pairs,
                         .stator_resistance_ohm = d.resistance_ohm,
                         .resistance_sigma_ratio = d.resistance_sigma_ratio,
                         .rotor_resistance_ohm = m.rotor_resistance_ohm,
                         .rotor_sigma_ratio = kRotorResistanceSigma_ratio,
                         .rated_torque_nm = m.rated_torque_nm,
                         .rated_frequency_rad_s = d.rated_frequency_rad_s,
                         .iron_torque_nm = iron_nm,
                         .iron_torque_sigma_nm = iron_sigma * m.rated_torque_nm},
          .meter = {.lag_s = m.meter_lag_s > tick_s ? m.meter_lag_s : tick_s,
                    .rated_power_w = m.rated_power_w,
                    .gain_sigma_ratio = kSensorGainSigma_ratio,
                    .meter_sigma_ratio = kMeterSigma_ratio,
                    .implausible_ratio = kMeterImplausible_ratio},
          .leakage_inductance_h = m.leakage_inductance_h,
          .rated_flux_v_s = d.flux_v_s,
          .speed_delay_ticks = delay < 15.0F ? static_cast<std::uint32_t>(delay) : 15U,
          .sensorless = sensorless,
          .track_resistance = true,
          .calibrate = true};
}

}  // namespace cutforce::firmware::from_machine
