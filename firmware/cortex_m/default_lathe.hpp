// The default lathe.
// Written by `cutforce embed`; change the machine file and write it anew.
#pragma once

#include "firmware/machine.hpp"
#include "firmware/machine_check.hpp"

namespace cutforce::firmware {

// clang-format off
inline constexpr Machine kMachine = [] {
  Machine m{};
  m.voltage_kind = static_cast<decltype(m.voltage_kind)>(0);  // line_to_neutral
  m.current_w_present = true;
  m.speed_present = true;
  m.power_meter_present = true;
  m.sample_rate_hz = 0x1.388p+12F;
  m.voltage_gain_ratio = {0x1p+0F, 0x1p+0F, 0x1p+0F};
  m.voltage_offset_v = {0x0p+0F, 0x0p+0F, 0x0p+0F};
  m.current_gain_ratio = {0x1p+0F, 0x1p+0F, 0x1p+0F};
  m.current_offset_a = {0x0p+0F, 0x0p+0F, 0x0p+0F};
  m.voltage_lead_s = 0x0p+0F;
  m.voltage_limit_v = 0x1.9p+8F;
  m.current_limit_a = 0x1.2cp+7F;
  m.speed_limit_rad_s = 0x1.9p+9F;
  m.power_limit_w = 0x1.d4cp+14F;
  m.speed_lag_s = 0x0p+0F;
  m.gap_limit_s = 0x1.99999ap-4F;
  m.winding = static_cast<decltype(m.winding)>(1);  // delta
  m.pole_pairs = 0x1p+1F;
  m.stator_resistance_ohm = 0x1.8p-1F;
  m.stator_resistance_sigma_ratio = 0x1.99999ap-4F;
  m.rotor_resistance_ohm = 0x1.d0e56p-3F;
  m.leakage_inductance_h = 0x1.54c986p-9F;
  m.iron_loss_w = 0x0p+0F;
  m.iron_loss_declared = false;
  m.rated_power_w = 0x1.57cp+12F;
  m.rated_torque_nm = 0x1.18p+5F;
  m.rated_speed_rad_s = 0x1.3a3334p+7F;
  m.rated_frequency_hz = 0x1.a0ccccp+5F;
  m.rated_voltage_v_rms = 0x1.9p+7F;
  m.rated_current_a_rms = 0x1.7p+4F;
  m.inertia_kg_m2 = 0x1.eb851ep-4F;
  m.inertia_sigma_ratio = 0x1.99999ap-5F;
  m.coulomb_torque_nm = 0x1p+1F;
  m.viscous_nm_s_rad = 0x1.0624dep-7F;
  m.load_friction_speed_rad_s = {0x1.9p+5F, 0x1.a4p+6F, 0x1.9p+7F};
  m.load_friction_ratio = {0x1.be76c8p-5F, 0x1.eb851ep-5F, 0x1.1cac08p-4F};
  m.load_friction_1_nm = {0x1.89374cp-10F, 0x1.89374cp-10F, 0x1.89374cp-10F};
  m.gear_ratio = 0x1p+0F;
  m.workpiece_diameter_m = 0x1.99999ap-5F;
  m.minimum_speed_rad_s = 0x1.4p+3F;
  m.programmed_speed_rad_s = 0x0p+0F;
  m.meter_scale_ratio = 0x1p+0F;
  m.meter_offset_w = 0x0p+0F;
  m.meter_efficiency_ratio = 0x1p+0F;
  m.meter_lag_s = 0x1.333334p-2F;
  m.meter_noise_w = 0x1.4p+4F;
  m.estimator = static_cast<decltype(m.estimator)>(3);  // fused
  m.estimate_period_s = 0x1.0624dep-10F;
  m.control_period_s = 0x1.99999ap-5F;
  m.power_mode = static_cast<decltype(m.power_mode)>(0);  // dot_product
  m.speed_source = static_cast<decltype(m.speed_source)>(0);  // rotor
  m.fixed_power_factor_ratio = 0x1.bb67aep-1F;
  m.switch_mode = static_cast<decltype(m.switch_mode)>(0);  // absolute
  m.switch_threshold_ratio = 0x1.47ae14p-4F;
  m.switch_hold_s = 0x1.99999ap-3F;
  m.switch_compensation_ratio = 0x1.f0a3d8p-1F;
  m.power_floor_w = 0x1.9p+6F;
  m.edge_slope_1_s = 0x1.8p+3F;
  m.drift_1_sqrt_s = 0x1.374bc6p-7F;
  m.controller = static_cast<decltype(m.controller)>(7);  // predictive
  m.force_reference_n = 0x1.f4p+8F;
  m.force_limit_n = 0x1.f4p+9F;
  m.pi_proportional_pct_n = 0x1.99999ap-4F;
  m.pi_integral_pct_n_s = 0x1.666666p-1F;
  m.override_floor_pct = 0x1.4p+4F;
  m.override_ceiling_pct = 0x1.9p+7F;
  m.override_initial_pct = 0x1.9p+6F;
  m.override_step_pct = 0x1p+0F;
  m.slew_up_pct_s = 0x1.f4p+9F;
  m.slew_down_pct_s = 0x1.f4p+9F;
  m.cut_threshold_n = 0x1.ep+5F;
  m.override_code = static_cast<decltype(m.override_code)>(0);  // binary
  m.process_gain_n_pct = 0x1p+2F;
  m.process_gain_least_n_pct = 0x1.99999ap-3F;
  m.process_gain_most_n_pct = 0x1p+6F;
  m.override_latency_s = 0x1.1eb852p-5F;
  m.override_latency_sigma_s = 0x1.89374cp-8F;
  m.feed_lag_s = 0x1.eb851ep-6F;
  m.process_lag_s = 0x1.99999ap-4F;
  m.force_lag_s = 0x1.47ae14p-8F;
  m.feed_exponent_ratio = 0x1.ba5e36p-1F;
  m.pi_supervise = false;
  m.pid_proportional_pct_n = 0x1.99999ap-4F;
  m.pid_integral_time_s = 0x1.333334p-3F;
  m.pid_derivative_time_s = 0x1.47ae14p-7F;
  m.pid_derivative_filter_ratio = 0x1.4p+3F;
  m.pole_assignment_pole_1_ratio = 0x1.99999ap-1F;
  m.pole_assignment_pole_2_ratio = 0x0p+0F;
  m.pole_assignment_learning_ratio = 0x1.99999ap-3F;
  m.mrac_model_time_s = 0x1.333334p-2F;
  m.mrac_adaptation_hz = 0x1p+2F;
  m.variable_gain_open_loop_1_s = 0x1p+2F;
  m.variable_gain_smoothing_s = 0x1.99999ap-4F;
  m.fuzzy_error_range_n = 0x1.f4p+7F;
  m.fuzzy_change_range_n = 0x1.f4p+7F;
  m.fuzzy_step_range_pct = 0x1.8p+3F;
  m.predictive_noise_ratio = 0x1.47ae14p-6F;
  m.predictive_noise_n = 0x1p+2F;
  m.predictive_jump_ratio = 0x1.0cccccp+2F;
  m.predictive_calm_horizon_s = 0x1.99999ap-2F;
  m.predictive_recovery_1_s = 0x1.14bc6ap+0F;
  m.predictive_caution_ratio = 0x1.4e2196p-2F;
  m.predictive_learns = true;
  m.predictive_finds_latency = false;
  m.cut_drop_ratio = 0x1.99999ap-4F;
  m.cut_lost_s = 0x1p-1F;
  m.pole_assignment_printed_rate_1_pct = 0x0p+0F;
  m.mrac_form = static_cast<decltype(m.mrac_form)>(0);  // output_error
  m.mrac_model_pole_1_hz = 0x1.4p+2F;
  m.mrac_model_pole_2_hz = 0x1.4p+3F;
  m.mrac_plant_n_mm_s2 = 0x1.795b34p+12F;
  m.mrac_state_scale_ratio = 0x1.a66666p+2F;
  m.mrac_state_gain_ratio = 0x1.2p+4F;
  m.mrac_feed_mm_s_pct = 0x1.47ae14p-5F;
  m.supervisor_mode = static_cast<decltype(m.supervisor_mode)>(0);  // advise
  m.link_required = true;
  m.fallback_pct = 0x1.18p+6F;
  m.hold_pct = 0x0p+0F;
  m.fall_pct_s = 0x1.4p+2F;
  m.link_timeout_s = 0x1p-2F;
  m.samples_timeout_s = 0x1.99999ap-3F;
  m.estimate_timeout_s = 0x1p+1F;
  m.hold_release_s = 0x1p-1F;
  m.overrun_window_s = 0x1p+0F;
  m.overrun_ratio = 0x1.47ae14p-7F;
  return m;
}();
// clang-format on

static_assert(check(kMachine), "the machine breaks a rule: cutforce check says which");
static_assert(kMachine.sample_rate_hz > 0.0F, "an image has to know its sample rate");

}  // namespace cutforce::firmware
