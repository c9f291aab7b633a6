// Every parameter of one machine, as plain numbers in SI units. The table in parameter_table.hpp
// describes each of them (name, unit, range, default, sentence); a TOML file, the metadata of a
// recording, or a constexpr initialiser fills them; configuration.hpp turns them into the checked
// configs of the blocks. What is marked "0: derived" or "0: not given" may be 0 in a file; the
// first kind rating.hpp fills before anything is made.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

namespace cutforce::firmware {

enum class Winding : std::uint8_t { kStar, kDelta };
enum class VoltageKind : std::uint8_t { kLineToNeutral, kLineToLine };
enum class EstimatorName : std::uint8_t {
  kMeasured,
  kComputed,
  kSynthesized,
  kFused,
  kDynamometer
};
enum class ControllerName : std::uint8_t {
  kNone,
  kPi,
  kPid,
  kPoleAssignment,
  kMrac,
  kVariableGain,
  kFuzzy,
  kPredictive
};
enum class MracForm : std::uint8_t { kOutputError, kStateError };
enum class SupervisorMode : std::uint8_t { kAdvise, kControl };
enum class PowerMode : std::uint8_t { kDotProduct, kTwoWattmeter, kFixedPowerFactor };
enum class SpeedSource : std::uint8_t { kRotor, kSynchronous, kSlip };
enum class SwitchMode : std::uint8_t { kAbsolute, kPositiveOnly };
enum class OverrideCode : std::uint8_t {
  kBinary,
  kFanucFv,
  kFanucOv10,
  kSiemensGray,
  kSiemensBinary
};

struct Machine {
  // [signals] what the sensors deliver. Corrected value = gain * (raw - offset).
  VoltageKind voltage_kind;
  bool current_w_present;  // false: i_w = -(i_u + i_v)
  bool speed_present;
  bool power_meter_present;
  float sample_rate_hz;  // 0: from the recording
  std::array<float, 3> voltage_gain_ratio;
  std::array<float, 3> voltage_offset_v;
  std::array<float, 3> current_gain_ratio;
  std::array<float, 3> current_offset_a;
  float voltage_lead_s;  // voltages stand for an instant this much after the currents'
  float voltage_limit_v;
  float current_limit_a;
  float speed_limit_rad_s;
  float power_limit_w;
  float speed_lag_s;  // the drive's filter on its speed output
  float gap_limit_s;  // longer gaps restart the estimator

  // [motor]
  Winding winding;
  float pole_pairs;
  float stator_resistance_ohm;  // per phase; 0: derived from the rating
  float stator_resistance_sigma_ratio;
  float rotor_resistance_ohm;  // star-equivalent, stator side; 0: derived
  float leakage_inductance_h;  // star-equivalent total; 0: derived
  float iron_loss_w;           // at rated speed and flux
  bool iron_loss_declared;     // false: unknown, iron_loss_w is 0
  float rated_power_w;
  float rated_torque_nm;      // 0: derived
  float rated_speed_rad_s;    // at the shaft; 0: derived
  float rated_voltage_v_rms;  // line to line; 0: derived
  float rated_current_a_rms;  // line current; 0: derived
  float rated_frequency_hz;   // 0: derived from power and torque
  float inertia_kg_m2;        // all that turns, seen from the motor
  float inertia_sigma_ratio;

  // [friction] of motor and spindle, seen from the motor
  float coulomb_torque_nm;
  float viscous_nm_s_rad;
  std::array<float, 3> load_friction_speed_rad_s;  // support points of both tables
  std::array<float, 3> load_friction_ratio;        // f(omega), P3 (8)
  std::array<float, 3> load_friction_1_nm;         // g(omega), P3 (8)

  // [spindle] and workpiece
  float gear_ratio;              // motor turns per spindle turn
  float workpiece_diameter_m;    // or tool diameter (milling); 0: not given
  float minimum_speed_rad_s;     // below it there is no estimate
  float programmed_speed_rad_s;  // motor speed that the program asks for; 0: not given

  // [power_meter]
  float meter_scale_ratio;
  float meter_offset_w;
  float meter_efficiency_ratio;  // shaft side of the drive / meter reading
  float meter_lag_s;
  float meter_noise_w;

  // [estimator]
  EstimatorName estimator;
  float estimate_period_s;  // 1 ms: the fused observer's tick
  float control_period_s;   // 50 ms
  PowerMode power_mode;
  SpeedSource speed_source;
  float fixed_power_factor_ratio;
  SwitchMode switch_mode;
  float switch_threshold_ratio;
  float switch_hold_s;
  float switch_compensation_ratio;
  float power_floor_w;
  float edge_slope_1_s;  // steepest force slope, rated torques per second
  float drift_1_sqrt_s;  // drift in the cut, rated torques per root second

  // [control]
  ControllerName controller;
  float force_reference_n;
  float force_limit_n;
  float pi_proportional_pct_n;
  float pi_integral_pct_n_s;
  float override_floor_pct;
  float override_ceiling_pct;
  float override_initial_pct;
  float override_step_pct;  // 1 or 10
  float slew_up_pct_s;
  float slew_down_pct_s;
  float cut_threshold_n;  // above it the tool is in the cut
  OverrideCode override_code;

  // [control] the process, as the laws are told
  float process_gain_n_pct;
  float process_gain_least_n_pct;
  float process_gain_most_n_pct;
  float override_latency_s;
  float override_latency_sigma_s;
  float feed_lag_s;
  float process_lag_s;
  float force_lag_s;
  float feed_exponent_ratio;

  // [control] one law each
  bool pi_supervise;
  float pid_proportional_pct_n;
  float pid_integral_time_s;
  float pid_derivative_time_s;
  float pid_derivative_filter_ratio;
  float pole_assignment_pole_1_ratio;
  float pole_assignment_pole_2_ratio;
  float pole_assignment_learning_ratio;
  float mrac_model_time_s;
  float mrac_adaptation_hz;
  float variable_gain_open_loop_1_s;
  float variable_gain_smoothing_s;
  float fuzzy_error_range_n;
  float fuzzy_change_range_n;
  float fuzzy_step_range_pct;
  float predictive_noise_ratio;
  float predictive_noise_n;
  float predictive_jump_ratio;
  float predictive_calm_horizon_s;
  float predictive_recovery_1_s;
  float predictive_caution_ratio;
  bool predictive_learns;
  bool predictive_finds_latency;

  // [control] as the papers print it
  float cut_drop_ratio;  // a fall of the force by more within a tick is steep; 1: never
  float cut_lost_s;      // a force that has gone for so long is the end of the cut
  float pole_assignment_printed_rate_1_pct;  // g_c; 0: not used
  MracForm mrac_form;
  float mrac_model_pole_1_hz;
  float mrac_model_pole_2_hz;
  float mrac_plant_n_mm_s2;
  float mrac_state_scale_ratio;
  float mrac_state_gain_ratio;  // mu
  float mrac_feed_mm_s_pct;

  // [supervisor] who may move the feed, and what goes out when nobody may
  SupervisorMode supervisor_mode;
  bool link_required;    // a CNC that sends MachineState
  float fallback_pct;    // where the override falls to after a fault
  float hold_pct;        // the feed-hold request
  float fall_pct_s;      // on the way to fallback_pct
  float link_timeout_s;  // since the last new frame
  float samples_timeout_s;
  float estimate_timeout_s;
  float hold_release_s;
  float overrun_window_s;
  float overrun_ratio;

  friend constexpr bool operator==(const Machine&, const Machine&) noexcept = default;
};
static_assert(std::is_trivially_copyable_v<Machine>);

// Time between two estimates. One a sample, where a dynamometer is slower than the usual period.
[[nodiscard]] constexpr float estimate_period_s(const Machine& m) noexcept {
  const bool slow = m.estimator == EstimatorName::kDynamometer && m.sample_rate_hz > 0.0F &&
                    m.estimate_period_s * m.sample_rate_hz < 0.999F;
  return slow && m.estimate_period_s > 0.0F ? 1.0F / m.sample_rate_hz : m.estimate_period_s;
}

}  // namespace cutforce::firmware
