// The one table of all parameters (STYLE: configuration). The commented TOML file, the check of it,
// the page of documentation and the CAN index are read from here and from nowhere else.
//
// Two values stand for each: what holds where nobody says anything (neutral, or 0 for "derived from
// the rating"), and that of the default machine, the 5.5 kW lathe of the turning paper's
// reproduction. They differ where a lathe's number would be a wrong guess for another machine.
//
// An index is never given twice, not even after its parameter has gone: it is on the CAN bus.
#pragma once

#include <algorithm>
#include <expected>
#include <optional>

#include "firmware/parameter_describe.hpp"
#include "firmware/parameter_table_control.hpp"
#include "firmware/parameter_table_printed.hpp"
#include "firmware/parameter_table_supervisor.hpp"

namespace cutforce::firmware {
namespace detail {

[[nodiscard]] consteval auto machine_parameters() {
  using M = Machine;
  using enum Write;
  return std::to_array<Parameter>({
      // [signals]
      choice<&M::voltage_kind>(0x0101, "voltage_kind", VoltageKind::kLineToNeutral,
                               VoltageKind::kLineToNeutral, kConstruction,
                               "What the three voltages are measured between."),
      flag<&M::current_w_present>(
          0x0102, "current_w_present", true, true, kConstruction,
          "Whether the third line current is measured; without it, it is -(i_u + i_v)."),
      flag<&M::speed_present>(0x0103, "speed_present", true, true, kConstruction,
                              "Whether the motor's speed is measured."),
      flag<&M::power_meter_present>(0x0104, "power_meter_present", true, true, kConstruction,
                                    "Whether the drive's own power output is connected."),
      number<&M::sample_rate_hz>(0x0105, "sample_rate_hz", "Hz", {2, 200000}, 0, 0, kConstruction,
                                 "Samples a second.", "from the recording"),
      triple<&M::voltage_gain_ratio>(
          0x0106, "voltage_gain_ratio", "", {-100, 100}, {1, 1, 1}, {1, 1, 1}, kIdle,
          "Gain of each voltage channel: corrected = gain * (raw - offset)."),
      triple<&M::voltage_offset_v>(0x0107, "voltage_offset_v", "V", {-1000, 1000}, {}, {}, kIdle,
                                   "What each voltage channel reads at no voltage."),
      triple<&M::current_gain_ratio>(
          0x0108, "current_gain_ratio", "", {-100, 100}, {1, 1, 1}, {1, 1, 1}, kIdle,
          "Gain of each current channel: corrected = gain * (raw - offset)."),
      triple<&M::current_offset_a>(0x0109, "current_offset_a", "A", {-1000, 1000}, {}, {}, kIdle,
                                   "What each current channel reads at no current."),
      number<&M::voltage_lead_s>(
          0x010a, "voltage_lead_s", "s", {-0.01F, 0.01F}, 0, 0, kConstruction,
          "How much later the instant is that a voltage stands for than that of its current; a "
          "drive's voltage reference leads by half its switching period."),
      number<&M::voltage_limit_v>(
          0x010b, "voltage_limit_v", "V", {1, 20000}, 20000, 400, kConstruction,
          "Peak (not rms) beyond which a voltage sample is not believed: the end of "
          "the sensor's range."),
      number<&M::current_limit_a>(
          0x010c, "current_limit_a", "A", {0.1F, 20000}, 20000, 150, kConstruction,
          "Peak (not rms) beyond which a current sample is not believed: the end of "
          "the sensor's range."),
      number<&M::speed_limit_rad_s>(0x010d, "speed_limit_rad_s", "rad/s", {1, 20000}, 20000, 800,
                                    kConstruction,
                                    "Motor speed beyond which a sample is not believed."),
      number<&M::power_limit_w>(0x010e, "power_limit_w", "W", {10, 2e6F}, 2e6F, 30000,
                                kConstruction,
                                "Power beyond which the power meter is not believed."),
      number<&M::speed_lag_s>(0x010f, "speed_lag_s", "s", {0, 0.1F}, 0, 0, kConstruction,
                              "Lag of the filter through which the drive gives its speed."),
      number<&M::gap_limit_s>(0x0110, "gap_limit_s", "s", {0.001F, 10}, 0.1F, 0.1F, kConstruction,
                              "A longer gap between samples restarts the estimator."),

      // [motor]
      choice<&M::winding>(0x0201, "winding", Winding::kStar, Winding::kDelta, kConstruction,
                          "How the stator winding is connected."),
      whole<&M::pole_pairs>(
          0x0202, "pole_pairs", {1, 64}, 2, 2, kConstruction,
          "Pole pairs, half the number of poles; 2 for a motor near 1500 rpm at 50 Hz. It must be "
          "given."),
      number<&M::stator_resistance_ohm>(
          0x0203, "stator_resistance_ohm", "ohm", {0.0001F, 500}, 0, 0.75F, kIdle,
          "Resistance of one stator phase when warm; between two terminals a star "
          "shows twice, a delta two thirds of it.",
          kDerived),
      number<&M::stator_resistance_sigma_ratio>(0x0204, "stator_resistance_sigma_ratio", "",
                                                {0.0001F, 1}, 0.1F, 0.1F, kIdle,
                                                "Standard deviation of stator_resistance_ohm, as a "
                                                "part of it."),
      number<&M::rotor_resistance_ohm>(
          0x0205, "rotor_resistance_ohm", "ohm", {0.0001F, 500}, 0, 0.227F, kIdle,
          "Rotor resistance seen from the stator, of the equivalent star.", kDerived),
      number<&M::leakage_inductance_h>(
          0x0206, "leakage_inductance_h", "H", {1e-6F, 10}, 0, 0.0026F, kIdle,
          "Total leakage inductance seen from the stator, of the equivalent star.", kDerived),
      number<&M::iron_loss_w>(0x0207, "iron_loss_w", "W", {0, 100000}, 0, 0, kIdle,
                              "Iron loss at rated speed and flux; giving it declares it."),
      flag<&M::iron_loss_declared>(
          0x0208, "iron_loss_declared", false, false, kConstruction,
          "Whether iron_loss_w is known; only then is the stator resistance adapted at speed."),
      number<&M::rated_power_w>(0x0209, "rated_power_w", "W", {50, 1e6F}, 0, 5500, kConstruction,
                                "Rated shaft power.", "derived from torque and speed"),
      number<&M::rated_torque_nm>(0x020a, "rated_torque_nm", "N m", {0.01F, 100000}, 0, 35,
                                  kConstruction, "Rated shaft torque.",
                                  "derived from power and speed"),
      number<&M::rated_speed_rad_s>(
          0x020b, "rated_speed_rad_s", "rad/s", {1, 20000}, 0, 157.1F, kConstruction,
          "Rated shaft speed, of a spindle motor its base speed.", "derived from power and torque"),
      number<&M::rated_frequency_hz>(0x020c, "rated_frequency_hz", "Hz", {2, 4000}, 0, 52.1F,
                                     kConstruction, "Stator frequency at the rated point.",
                                     kDerived),
      number<&M::rated_voltage_v_rms>(0x020d, "rated_voltage_v_rms", "V", {10, 12000}, 0, 200,
                                      kConstruction, "Rated line-to-line voltage, rms.", kDerived),
      number<&M::rated_current_a_rms>(0x020e, "rated_current_a_rms", "A", {0.05F, 5000}, 0, 23,
                                      kConstruction, "Rated line current, rms.", kDerived),
      number<&M::inertia_kg_m2>(
          0x020f, "inertia_kg_m2", "kg m2", {1e-6F, 1000}, 0, 0.12F, kIdle,
          "Inertia of all that turns (motor, spindle, chuck, workpiece), seen from the motor.",
          kDerived),
      number<&M::inertia_sigma_ratio>(0x0210, "inertia_sigma_ratio", "", {0.0001F, 1}, 0.15F, 0.05F,
                                      kIdle,
                                      "Standard deviation of inertia_kg_m2, as a part of it."),

      // [friction]
      number<&M::coulomb_torque_nm>(
          0x0301, "coulomb_torque_nm", "N m", {0, 10000}, 0, 2, kIdle,
          "Friction torque that does not change with speed, seen from the motor."),
      number<&M::viscous_nm_s_rad>(0x0302, "viscous_nm_s_rad", "N m s/rad", {0, 100}, 0, 0.008F,
                                   kIdle, "Friction torque for each rad/s of motor speed."),
      triple<&M::load_friction_speed_rad_s>(
          0x0303, "load_friction_speed_rad_s", "rad/s", {0, 20000}, {50, 100, 200}, {50, 105, 200},
          kIdle, "Motor speeds at which the two tables of load friction are given; increasing."),
      triple<&M::load_friction_ratio>(
          0x0304, "load_friction_ratio", "", {0, 1}, {}, {0.0545F, 0.06F, 0.0695F}, kIdle,
          "Friction torque for each N m of cutting torque, at each of these speeds."),
      triple<&M::load_friction_1_nm>(
          0x0305, "load_friction_1_nm", "1/(N m)", {0, 1}, {}, {0.0015F, 0.0015F, 0.0015F}, kIdle,
          "Friction torque for each square N m of cutting torque, at each of these speeds."),

      // [spindle]
      number<&M::gear_ratio>(0x0401, "gear_ratio", "", {0.01F, 100}, 1, 1, kIdle,
                             "Motor turns for each spindle turn."),
      number<&M::workpiece_diameter_m>(
          0x0402, "workpiece_diameter_m", "m", {0.0001F, 20}, 0, 0.05F, kAnyTime,
          "Diameter at which the force acts: of the workpiece, in milling of the tool.",
          "not given, torque only"),
      number<&M::minimum_speed_rad_s>(0x0403, "minimum_speed_rad_s", "rad/s", {0.1F, 2000}, 10, 10,
                                      kConstruction,
                                      "Motor speed below which there is no estimate."),
      number<&M::programmed_speed_rad_s>(
          0x0404, "programmed_speed_rad_s", "rad/s", {0.1F, 20000}, 0, 0, kAnyTime,
          "Motor speed that the program asks for: a feed per turn follows the speed, and with it "
          "the force.",
          "not given, the speed is taken to be as programmed"),

      // [power_meter]
      number<&M::meter_scale_ratio>(0x0501, "meter_scale_ratio", "", {0.001F, 1000}, 1, 1, kIdle,
                                    "Power for each W that the meter reads."),
      number<&M::meter_offset_w>(0x0502, "meter_offset_w", "W", {-100000, 100000}, 0, 0, kIdle,
                                 "What the meter reads at no power."),
      number<&M::meter_efficiency_ratio>(
          0x0503, "meter_efficiency_ratio", "", {0.05F, 1}, 1, 1, kIdle,
          "Power that crosses the air gap, as a part of the meter's reading."),
      number<&M::meter_lag_s>(0x0504, "meter_lag_s", "s", {0, 10}, 0.3F, 0.3F, kConstruction,
                              "Time constant with which the meter follows."),
      number<&M::meter_noise_w>(0x0505, "meter_noise_w", "W", {0, 100000}, 20, 20, kConstruction,
                                "Standard deviation of one reading of the meter."),

      // [estimator]
      choice<&M::estimator>(0x0601, "estimator", EstimatorName::kFused, EstimatorName::kFused,
                            kConstruction, "Which estimate feeds the output."),
      number<&M::estimate_period_s>(0x0602, "estimate_period_s", "s", {0.00005F, 0.5F}, 0.001F,
                                    0.001F, kConstruction,
                                    "Time between two estimates, whole samples long."),
      number<&M::control_period_s>(0x0603, "control_period_s", "s", {0.001F, 1}, 0.05F, 0.05F,
                                   kConstruction,
                                   "Time between two feed overrides, whole estimates long."),
      choice<&M::power_mode>(
          0x0604, "power_mode", PowerMode::kDotProduct, PowerMode::kDotProduct, kConstruction,
          "How electrical power is computed; fixed_pf only reproduces the paper."),
      choice<&M::speed_source>(
          0x0605, "speed_source", SpeedSource::kRotor, SpeedSource::kRotor, kConstruction,
          "Which speed turns air-gap power into torque in the estimator computed."),
      number<&M::fixed_power_factor_ratio>(0x0606, "fixed_power_factor_ratio", "", {0.05F, 1},
                                           0.8660254F, 0.8660254F, kConstruction,
                                           "Power factor that fixed_pf assumes."),
      choice<&M::switch_mode>(0x0607, "switch_mode", SwitchMode::kAbsolute, SwitchMode::kAbsolute,
                              kConstruction,
                              "Which difference between computed and measured power switches the "
                              "synthesized estimate."),
      number<&M::switch_threshold_ratio>(
          0x0608, "switch_threshold_ratio", "", {0.001F, 2}, 0.08F, 0.08F, kIdle,
          "Difference that switches, as a part of the measured power."),
      number<&M::switch_hold_s>(
          0x0609, "switch_hold_s", "s", {0, 10}, 0.2F, 0.2F, kIdle,
          "How long the computed power stays in use after the difference has gone."),
      number<&M::switch_compensation_ratio>(0x060a, "switch_compensation_ratio", "", {0.5F, 1.5F},
                                            0.97F, 0.97F, kIdle,
                                            "Factor on the computed torque while it is in use."),
      number<&M::power_floor_w>(
          0x060b, "power_floor_w", "W", {0.1F, 100000}, 100, 100, kIdle,
          "Measured power below which the difference is taken relative to this."),
      number<&M::edge_slope_1_s>(0x060c, "edge_slope_1_s", "1/s", {0.01F, 1000}, 12, 12,
                                 kConstruction,
                                 "Steepest load to be followed, in rated torques a second."),
      number<&M::drift_1_sqrt_s>(
          0x060d, "drift_1_sqrt_s", "1/sqrt(s)", {1e-6F, 10}, 0.0095F, 0.0095F, kConstruction,
          "Drift of the load within a cut, in rated torques after a second."),

  });
}

}  // namespace detail

inline constexpr auto kParameters = detail::joined(
    detail::machine_parameters(),
    detail::joined(detail::control_parameters(),
                   detail::joined(detail::printed_parameters(), detail::supervisor_parameters())));

// Position in kParameters, or none.
[[nodiscard]] constexpr std::optional<std::size_t> find_parameter(std::string_view key) noexcept {
  const auto found = std::ranges::find(kParameters, key, &Parameter::key);
  if (found == kParameters.end()) return std::nullopt;
  return static_cast<std::size_t>(found - kParameters.begin());
}

namespace detail {
[[nodiscard]] constexpr Machine filled_from(std::array<float, 3> Parameter::*column) noexcept {
  Machine machine{};
  for (const Parameter& parameter : kParameters) {
    for (std::size_t k = 0; k < parameter.size(); ++k) {
      parameter.set(machine, k, (parameter.*column)[k]);
    }
  }
  return machine;
}
}  // namespace detail

// The 5.5 kW lathe.
[[nodiscard]] constexpr Machine default_machine() noexcept {
  return detail::filled_from(&Parameter::lathe);
}
// What holds before anybody has said anything.
[[nodiscard]] constexpr Machine unspecified_machine() noexcept {
  return detail::filled_from(&Parameter::absent);
}

}  // namespace cutforce::firmware
