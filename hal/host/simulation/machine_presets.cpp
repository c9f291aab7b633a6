#include "hal/host/simulation/arithmetic.hpp"
#include "hal/host/simulation/machine_config.hpp"

namespace cutforce::hal::host {
namespace {

constexpr double kRoot2 = 1.41421356237309504880;
constexpr double kRpm = kTwoPi / 60.0;  // rad/s

// Magnetise for 0.15 s, then ramp up in 0.6 s: idle from 1 s on.
Profile run_up(double speed_rad_s) { return Profile{{0.0, 0.0}, {0.15, 0.0}, {0.75, speed_rad_s}}; }

SimulatedMachineConfig on_400_v(const MotorConfig& motor, double inertia_kg_m2) {
  return {.sample_rate_hz = 5000.0,
          .motor = motor,
          .inverter = {.dc_link_v = 540.0},
          .drive = {.control = DriveControl::kVector,
                    .period_s = 125e-6,
                    .speed_reference_rad_s = run_up(1500.0 * kRpm),
                    .speed_bandwidth_rad_s = kTwoPi * 4.0,
                    .current_bandwidth_rad_s = kTwoPi * 200.0,
                    .torque_limit_nm = 1.7 * motor.rated_torque_nm,
                    .current_limit_a = 2.0 * kRoot2 * motor.rated_current_a_rms},
          .spindle = {.inertia_kg_m2 = inertia_kg_m2},
          .sensors = {.power_meter = {.lag_s = 0.3}}};
}

}  // namespace

SimulatedMachineConfig motor_a() {
  const MotorConfig motor{.pole_pairs = 2.0,
                          .stator_resistance_ohm = 3.7,
                          .rotor_resistance_ohm = 2.5,
                          .leakage_inductance_h = 0.023,
                          .stator_inductance_h = 0.34,
                          .saturation_1_vs = 0.84,
                          .saturation_exponent = 7.0,
                          .rated_flux_vs = 1.0396,  // 400 V, 50 Hz
                          .rated_speed_rad_s = kTwoPi * 50.0,
                          .rated_torque_nm = 14.6,
                          .rated_current_a_rms = 5.0};
  SimulatedMachineConfig machine = on_400_v(motor, 0.03);
  machine.spindle.coulomb_torque_nm = 0.4;
  machine.spindle.viscous_nm_s_rad = 0.002;
  machine.load_friction.ratio = Profile{0.05};
  return machine;
}

SimulatedMachineConfig motor_b() {
  MotorConfig motor{.pole_pairs = 2.0,
                    .stator_resistance_ohm = 0.72,
                    .rotor_resistance_ohm = 0.73,
                    .leakage_inductance_h = 9.2e-3,
                    .stator_inductance_h = 0.118,
                    .saturation_1_vs = 0.84,
                    .saturation_exponent = 7.0,
                    .rated_flux_vs = 1.0396,
                    .rated_speed_rad_s = kTwoPi * 50.0,
                    .rated_torque_nm = 49.4,
                    .rated_current_a_rms = 15.0};
  SimulatedMachineConfig machine = on_400_v(motor, 0.08);
  machine.spindle.coulomb_torque_nm = 1.0;
  machine.spindle.viscous_nm_s_rad = 0.006;
  machine.load_friction.ratio = Profile{0.05};
  return machine;
}

SimulatedMachineConfig default_lathe() {
  const MotorConfig motor{.pole_pairs = 2.0,
                          .stator_resistance_ohm = 0.25,  // 0.75 in each delta phase
                          .rotor_resistance_ohm = 0.265,
                          .leakage_inductance_h = 3.0e-3,
                          .stator_inductance_h = 38.4e-3,
                          .saturation_1_vs = 1.68,
                          .saturation_exponent = 7.0,
                          .rated_flux_vs = 0.52,  // 200 V, 50 Hz
                          .rated_speed_rad_s = kTwoPi * 50.0,
                          .rated_torque_nm = 35.0,
                          .rated_current_a_rms = 23.0,
                          .resistance_slope_1_k = 0.0039};
  return {.sample_rate_hz = 5000.0,
          .motor = motor,
          .inverter = {.dc_link_v = 200.0 * kRoot2},
          .drive = {.control = DriveControl::kVector,
                    .period_s = 200e-6,
                    .speed_reference_rad_s = run_up(1000.0 * kRpm),
                    .speed_bandwidth_rad_s = kTwoPi * 4.0,
                    .current_bandwidth_rad_s = kTwoPi * 120.0,
                    .torque_limit_nm = 60.0,
                    .current_limit_a = 70.0},
          .spindle = {.inertia_kg_m2 = 0.12, .coulomb_torque_nm = 2.0, .viscous_nm_s_rad = 0.008},
          // 0.06 + 1e-4 (w - 105)
          .load_friction = {.ratio = Profile{{0.0, 0.0495}, {105.0, 0.06}, {315.0, 0.081}},
                            .per_nm_1_nm = Profile{0.0015}},
          .process = {.specific_force_n_m2 = 2e9,
                      .nominal_feed_m_rev = 0.2e-3,
                      .lag_s = 0.1,
                      .depth_m = Profile{{0.0, 0.0},
                                         {0.003, 0.0},
                                         {0.003, 1e-3},
                                         {0.015, 1e-3},
                                         {0.015, 1.5e-3},
                                         {0.027, 1.5e-3},
                                         {0.027, 0.0}},
                      .diameter_m = Profile{0.05}},
          .feed = {.start_s = 1.5,
                   .feed_m_rev = 0.2e-3,
                   .length_m = 0.030,
                   .latency_s = 0.025,
                   .scan_s = 0.020,
                   .lag_s = 0.030},
          .sensors = {.power_meter = {.dead_time_s = 0.1, .lag_s = 0.1}}};
}

}  // namespace cutforce::hal::host
