// What a faultless commissioning would find of a simulated machine.
#include <algorithm>
#include <cmath>

#include "firmware/host/compare/part.hpp"
#include "firmware/host/scenario/scenario.hpp"
#include "firmware/parameter_table.hpp"
#include "hal/host/simulation/arithmetic.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::Profile;
using hal::host::SimulatedMachineConfig;

constexpr float kLeastLag_s = 0.001F;  // that a machine file can say

float narrow(double value) { return static_cast<float>(value); }

double at(const Profile& profile, double where) {
  hal::host::ProfileCursor cursor;
  return cursor.value(profile, where);
}

void set_motor(Machine& m, const SimulatedMachineConfig& s) {
  const double star = m.winding == Winding::kDelta ? 3.0 : 1.0;
  const auto values = hal::host::inverse_gamma(s.motor, s.motor.rated_flux_vs);
  m.pole_pairs = narrow(s.motor.pole_pairs);
  m.stator_resistance_ohm = narrow(star * s.motor.stator_resistance_ohm *
                                   (1.0 + s.motor.resistance_slope_1_k * s.motor.initial_rise_k));
  m.rotor_resistance_ohm = narrow(values.rotor_resistance_ohm);
  m.leakage_inductance_h = narrow(values.leakage_inductance_h);
  m.rated_torque_nm = narrow(s.motor.rated_torque_nm);
  m.rated_current_a_rms = narrow(s.motor.rated_current_a_rms);
  // Flux times frequency is the peak of a phase.
  m.rated_voltage_v_rms =
      narrow(std::sqrt(1.5) * s.motor.rated_flux_vs * s.motor.rated_speed_rad_s);
}

void set_mechanics(Machine& m, const SimulatedMachineConfig& s) {
  m.inertia_kg_m2 = narrow(s.spindle.inertia_kg_m2);
  m.coulomb_torque_nm = narrow(s.spindle.coulomb_torque_nm);
  m.viscous_nm_s_rad = narrow(s.spindle.viscous_nm_s_rad);
  m.gear_ratio = narrow(s.spindle.gear_ratio);
  for (std::size_t k = 0; k < m.load_friction_ratio.size(); ++k) {
    const auto speed_rad_s = static_cast<double>(m.load_friction_speed_rad_s[k]);
    m.load_friction_ratio[k] = narrow(at(s.load_friction.ratio, speed_rad_s));
    m.load_friction_1_nm[k] = narrow(at(s.load_friction.per_nm_1_nm, speed_rad_s));
  }
  const bool cuts = s.process.specific_force_n_m2 > 0.0;
  m.workpiece_diameter_m = cuts ? narrow(at(s.process.diameter_m, 0.0)) : 0.0F;
}

void set_signals(Machine& m, const SimulatedMachineConfig& s) {
  m.sample_rate_hz = narrow(s.sample_rate_hz);
  m.voltage_kind = s.sensors.voltage_kind == hal::host::VoltageKind::kLineToLine
                       ? VoltageKind::kLineToLine
                       : VoltageKind::kLineToNeutral;
  m.current_w_present = s.sensors.current_w_present;
  m.speed_present = s.sensors.speed.present;
  m.power_meter_present = s.sensors.power_meter.present;
  m.voltage_lead_s = narrow(s.sensors.voltage_lead_s);
  m.speed_lag_s = narrow(s.sensors.speed.lag_s);
  const auto& meter = s.sensors.power_meter;
  const bool reads = meter.scale != 0.0;
  m.meter_scale_ratio = reads ? narrow(1.0 / meter.scale) : 1.0F;
  m.meter_offset_w = narrow(meter.offset_w);
  m.meter_lag_s = narrow(meter.lag_s + meter.dead_time_s);
}

// As a step test of the override would show it: half a scan belongs to the dead time.
void set_feed_and_cut(Machine& m, const SimulatedMachineConfig& s) {
  if (!(s.process.specific_force_n_m2 > 0.0)) return;
  const double scan_s = s.feed.scan_s + s.feed.scan_jitter_s;
  m.override_latency_s = narrow(s.feed.latency_s + 0.5 * scan_s);
  m.override_latency_sigma_s = narrow(scan_s / std::sqrt(12.0));
  m.feed_lag_s = std::max(narrow(s.feed.lag_s), kLeastLag_s);
  m.process_lag_s = std::max(narrow(s.process.lag_s), kLeastLag_s);
  m.feed_exponent_ratio = std::clamp(narrow(s.process.exponent), 0.3F, 1.5F);
}

// What the presets were made after.
double rated_power_w(Preset preset) {
  switch (preset) {
    case Preset::kLathe:
      return 5500.0;
    case Preset::kMotorA:
      return 2200.0;
    case Preset::kMotorB:
      return 7500.0;
  }
  return 0.0;
}

}  // namespace

SimulatedMachineConfig simulation_of(Preset preset) {
  switch (preset) {
    case Preset::kLathe:
      return hal::host::default_lathe();
    case Preset::kMotorA:
      return hal::host::motor_a();
    case Preset::kMotorB:
      return hal::host::motor_b();
  }
  return hal::host::default_lathe();
}

Machine machine_of(const SimulatedMachineConfig& simulation, Preset preset) {
  Machine m = preset == Preset::kLathe ? default_machine() : unspecified_machine();
  set_motor(m, simulation);
  set_mechanics(m, simulation);
  set_signals(m, simulation);
  set_feed_and_cut(m, simulation);
  m.rated_power_w = narrow(rated_power_w(preset) * simulation.motor.rated_torque_nm /
                           simulation_of(preset).motor.rated_torque_nm);
  m.rated_speed_rad_s = m.rated_power_w / m.rated_torque_nm;
  m.rated_frequency_hz = narrow(simulation.motor.rated_speed_rad_s / hal::host::kTwoPi);
  return m;
}

hal::host::ForceMachineConfig force_lathe() {
  hal::host::ForceMachineConfig force = comparison_lathe();
  force.feed.length_m = 0.027;
  force.process.depth_m = {{0.0, 0.0},      {0.003, 0.0},    {0.003, 0.001}, {0.015, 0.001},
                           {0.015, 0.0015}, {0.027, 0.0015}, {0.027, 0.0}};
  force.override_applied_present = true;
  return force;
}

Machine machine_of(const hal::host::ForceMachineConfig& force) {
  Machine m = default_machine();
  m.estimator = EstimatorName::kDynamometer;
  m.gear_ratio = narrow(force.gear_ratio);
  m.speed_present = force.speed_present;
  m.power_meter_present = false;
  return m;
}

}  // namespace cutforce::firmware::host
