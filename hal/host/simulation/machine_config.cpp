#include "hal/host/simulation/machine_config.hpp"

#include <cmath>
#include <cstddef>
#include <string>

#include "hal/host/simulation/config_checker.hpp"

namespace cutforce::hal::host {
namespace {

using Checker = ConfigChecker;

constexpr double kMost = 1e9;

void check_motor(Checker& c, const MotorConfig& m) {
  c.require(m.pole_pairs >= 1.0 && m.pole_pairs <= 50.0 && std::floor(m.pole_pairs) == m.pole_pairs,
            "motor.pole_pairs", "is not a whole number from 1 to 50",
            "give half the number of poles");
  c.positive(m.stator_resistance_ohm, "motor.stator_resistance_ohm", 1e3);
  c.positive(m.rotor_resistance_ohm, "motor.rotor_resistance_ohm", 1e3);
  c.positive(m.leakage_inductance_h, "motor.leakage_inductance_h", 10.0);
  c.positive(m.stator_inductance_h, "motor.stator_inductance_h", 100.0);
  c.within(m.saturation_1_vs, "motor.saturation_1_vs", 0.0, 1e3);
  c.within(m.saturation_exponent, "motor.saturation_exponent", 0.0, 30.0);
  c.require(!(m.saturation_1_vs > 0.0) || m.saturation_exponent >= 1.0, "motor.saturation_exponent",
            "is missing while saturation_1_vs is given",
            "give at least 1, or leave saturation_1_vs 0");
  c.within(m.iron_conductance_s, "motor.iron_conductance_s", 0.0, 1.0);
  c.positive(m.rated_flux_vs, "motor.rated_flux_vs", 100.0);
  c.positive(m.rated_speed_rad_s, "motor.rated_speed_rad_s", 1e5);
  c.positive(m.rated_torque_nm, "motor.rated_torque_nm", 1e6);
  c.positive(m.rated_current_a_rms, "motor.rated_current_a_rms", 1e5);
  c.within(m.resistance_slope_1_k, "motor.resistance_slope_1_k", 0.0, 0.1);
  c.within(m.thermal_resistance_k_w, "motor.thermal_resistance_k_w", 0.0, 1e3);
  c.positive(m.thermal_time_s, "motor.thermal_time_s", 1e6);
  c.within(m.initial_rise_k, "motor.initial_rise_k", -100.0, 500.0);
}

void check_drive(Checker& c, const InverterConfig& i, const DriveConfig& d) {
  c.positive(i.dc_link_v, "inverter.dc_link_v", 1e5);
  c.within(i.device_drop_v, "inverter.device_drop_v", 0.0, 0.1 * i.dc_link_v);
  c.within(i.anti_alias_hz, "inverter.anti_alias_hz", 0.0, 1e6);
  c.within(d.period_s, "drive.period_s", 10e-6, 5e-3);
  c.within(i.dead_time_s, "inverter.dead_time_s", 0.0, 0.2 * d.period_s);
  c.profile(d.speed_reference_rad_s, "drive.speed_reference_rad_s", -1e4, 1e4);
  if (d.control == DriveControl::kVoltsPerHertz) {
    c.within(d.resistance_compensation_ratio, "drive.resistance_compensation_ratio", 0.0, 2.0);
    c.within(d.slip_compensation_ratio, "drive.slip_compensation_ratio", 0.0, 1.2);
    c.positive(d.slip_filter_s, "drive.slip_filter_s", 10.0);
    c.within(d.current_damping_ohm, "drive.current_damping_ohm", 0.0, 1e3);
    c.positive(d.damping_filter_s, "drive.damping_filter_s", 10.0);
  } else {
    c.positive(d.speed_bandwidth_rad_s, "drive.speed_bandwidth_rad_s", 2e3);
    c.positive(d.current_bandwidth_rad_s, "drive.current_bandwidth_rad_s", 0.3 / d.period_s);
    c.positive(d.torque_limit_nm, "drive.torque_limit_nm", 1e6);
    c.positive(d.current_limit_a, "drive.current_limit_a", 1e6);
    c.within(d.voltage_use_ratio, "drive.voltage_use_ratio", 0.1, 1.0);
  }
}

void check_mechanics(Checker& c, const SimulatedMachineConfig& m) {
  c.positive(m.spindle.inertia_kg_m2, "spindle.inertia_kg_m2", 1e4);
  c.within(m.spindle.coulomb_torque_nm, "spindle.coulomb_torque_nm", 0.0, 1e5);
  c.within(m.spindle.viscous_nm_s_rad, "spindle.viscous_nm_s_rad", 0.0, 1e3);
  c.positive(m.spindle.gear_ratio, "spindle.gear_ratio", 1e3);
  c.profile(m.friction_ratio, "friction_ratio", 0.0, 100.0);
  c.profile(m.load_friction.ratio, "load_friction.ratio", 0.0, 10.0);
  c.profile(m.load_friction.per_nm_1_nm, "load_friction.per_nm_1_nm", 0.0, 10.0);
  c.profile(m.load.torque_nm, "load.torque_nm", -1e6, 1e6);
  for (const Oscillation& o : m.load.oscillations) {
    c.require(o.begin_s >= 0.0 && o.end_s > o.begin_s, "load.oscillations", "ends before it begins",
              "give end_s above begin_s");
    c.within(o.amplitude_nm, "load.oscillations", 0.0, 1e6);
    c.within(o.frequency_hz, "load.oscillations", 0.0, 0.1 / m.drive.period_s);
  }
}

void check_channel(Checker& c, const ChannelConfig& channel, const char* key) {
  c.require(std::isfinite(channel.gain) && std::isfinite(channel.offset), key,
            "has a gain or an offset that is no number", "give finite numbers");
  c.within(channel.noise, key, 0.0, kMost);
  c.within(channel.range, key, 0.0, kMost);
  c.within(channel.bits, key, 0.0, 32.0);
  const bool whole = std::floor(channel.bits) == channel.bits;
  c.require(channel.bits == 0.0 || (channel.range > 0.0 && whole), key,
            "has bits without a range, or not a whole number of them",
            "give range and a whole number of bits");
}

void check_sensors(Checker& c, const SimulatedMachineConfig& m) {
  const SensorConfig& s = m.sensors;
  static constexpr std::array<const char*, 3> kVoltage{"sensors.voltage[0]", "sensors.voltage[1]",
                                                       "sensors.voltage[2]"};
  static constexpr std::array<const char*, 3> kCurrent{"sensors.current[0]", "sensors.current[1]",
                                                       "sensors.current[2]"};
  for (std::size_t k = 0; k < 3; ++k) {
    check_channel(c, s.voltage[k], kVoltage[k]);
    check_channel(c, s.current[k], kCurrent[k]);
  }
  c.within(std::abs(s.voltage_lead_s), "sensors.voltage_lead_s", 0.0, 0.9 / m.sample_rate_hz);
  c.require(m.inverter.anti_alias_hz == 0.0 || s.voltage_signal == VoltageSignal::kInstantaneous,
            "inverter.anti_alias_hz", "has no effect on a mean or a reference voltage",
            "set sensors.voltage_signal to the instantaneous one, or the corner to 0");
  c.within(s.speed.noise_rad_s, "sensors.speed.noise_rad_s", 0.0, 1e4);
  c.within(s.speed.lag_s, "sensors.speed.lag_s", 0.0, 10.0);
  c.within(std::abs(s.speed.ripple_ratio), "sensors.speed.ripple_ratio", 0.0, 0.5);
  c.within(std::abs(s.speed.second_ripple_ratio), "sensors.speed.second_ripple_ratio", 0.0, 0.5);
  c.within(s.speed.encoder_counts, "sensors.speed.encoder_counts", 0.0, 1e8);
  c.within(s.speed.encoder_window_s, "sensors.speed.encoder_window_s", 0.0, 1.0);
  c.within(s.power_meter.dead_time_s, "sensors.power_meter.dead_time_s", 0.0, 100.0);
  c.within(s.power_meter.lag_s, "sensors.power_meter.lag_s", 0.0, 100.0);
  c.require(std::isfinite(s.power_meter.scale) && std::isfinite(s.power_meter.offset_w),
            "sensors.power_meter.scale", "or the offset is no number", "give finite numbers");
  c.within(s.power_meter.noise_w, "sensors.power_meter.noise_w", 0.0, 1e9);
  c.positive(s.power_meter.period_s, "sensors.power_meter.period_s", 1.0);
  c.require(std::isfinite(s.dynamometer.gain) && std::isfinite(s.dynamometer.offset_n),
            "sensors.dynamometer.gain", "or the offset is no number", "give finite numbers");
  c.within(s.dynamometer.noise_n, "sensors.dynamometer.noise_n", 0.0, 1e9);
  c.within(s.dynamometer.lag_s, "sensors.dynamometer.lag_s", 0.0, 10.0);
  for (const SignalFault& fault : m.faults) {
    c.require(fault.end_s > fault.begin_s, "faults", "contain one that ends before it begins",
              "give end_s above begin_s");
    c.require(fault.kind != SignalFaultKind::kGap || std::isfinite(fault.end_s), "faults",
              "contain a gap without an end", "give the gap an end_s");
  }
}

}  // namespace

std::expected<void, InputError> SimulatedMachineConfig::check() const {
  Checker c;
  c.within(sample_rate_hz, "sample_rate_hz", 100.0, 200e3);
  c.within(integration_step_s, "integration_step_s", 1e-7, 400e-6);
  check_motor(c, motor);
  check_drive(c, inverter, drive);
  check_mechanics(c, *this);
  check_cut(c, process, feed);
  check_sensors(c, *this);
  return c.result();
}

}  // namespace cutforce::hal::host
