// The part of machine_check.hpp that speaks of control. What a law cannot work with is refused
// where that law is chosen; the others wait with what fits (configuration_laws.hpp).
#pragma once

#include "firmware/machine_rule.hpp"

namespace cutforce::firmware::detail {

// Gain K_open T of the integral of variable_gain over the highest that is stable: with n periods of
// dead time 1/n, without any 2.
[[nodiscard]] constexpr float open_loop_share(const Machine& m) noexcept {
  const auto periods =
      static_cast<std::int32_t>(m.override_latency_s / m.control_period_s + 0.999F);
  const float highest = periods == 0 ? 2.0F : 1.0F / static_cast<float>(periods);
  return m.variable_gain_open_loop_1_s * m.control_period_s / highest;
}

inline constexpr auto kControlRules = std::to_array<MachineRule>({
    {{"force_reference_n", "force_limit_n"},
     [](const Machine& m) noexcept { return m.force_reference_n < m.force_limit_n; },
     "the force to hold is not below the limit",
     "raise force_limit_n or lower force_reference_n"},
    {{"cut_threshold_n", "force_reference_n"},
     [](const Machine& m) noexcept { return m.cut_threshold_n < m.force_reference_n; },
     "the cut would be noticed only above the force to hold",
     "lower cut_threshold_n"},
    {{"override_floor_pct", "override_ceiling_pct"},
     [](const Machine& m) noexcept { return m.override_floor_pct < m.override_ceiling_pct; },
     "the floor is not below the ceiling",
     "lower the floor or raise the ceiling"},
    {{"override_initial_pct", "override_floor_pct", "override_ceiling_pct"},
     [](const Machine& m) noexcept {
       return m.override_initial_pct >= m.override_floor_pct &&
              m.override_initial_pct <= m.override_ceiling_pct;
     },
     "the first override is not between floor and ceiling",
     "give a value between the two"},
    {{"override_step_pct"},
     [](const Machine& m) noexcept {
       return m.override_step_pct == 1.0F || m.override_step_pct == 10.0F;
     },
     "no CNC understands this step",
     "give 1 or 10"},
    {{"override_initial_pct", "override_step_pct"},
     [](const Machine& m) noexcept {
       const auto percent = static_cast<std::uint32_t>(m.override_initial_pct);
       return !(static_cast<float>(percent) < m.override_initial_pct) &&
              percent % static_cast<std::uint32_t>(m.override_step_pct) == 0;
     },
     "the CNC cannot be told the first override",
     "give a multiple of override_step_pct"},
    {{"override_ceiling_pct", "override_code"},
     [](const Machine& m) noexcept {
       return (m.override_code != OverrideCode::kSiemensGray &&
               m.override_code != OverrideCode::kSiemensBinary) ||
              m.override_ceiling_pct <= 200.0F;
     },
     "the codes of Siemens end at 200 %",
     "set override_ceiling_pct = 200 or less"},
    {{"override_code", "override_step_pct", "override_ceiling_pct"},
     [](const Machine& m) noexcept {
       return m.override_code != OverrideCode::kFanucOv10 ||
              (m.override_step_pct == 10.0F && m.override_ceiling_pct <= 150.0F);
     },
     "fanuc_ov_10 has steps of 10 % up to 150 %",
     "set override_step_pct = 10 and override_ceiling_pct = 150 or less"},
    {{"process_gain_least_n_pct", "process_gain_most_n_pct"},
     [](const Machine& m) noexcept {
       return m.process_gain_least_n_pct < m.process_gain_most_n_pct;
     },
     "the lowest process gain is not below the highest",
     "lower the first or raise the second"},
    {{"process_gain_n_pct", "process_gain_least_n_pct", "process_gain_most_n_pct"},
     [](const Machine& m) noexcept {
       return m.process_gain_n_pct >= m.process_gain_least_n_pct &&
              m.process_gain_n_pct <= m.process_gain_most_n_pct;
     },
     "the usual process gain is not between the lowest and the highest",
     "give the force at 100 % over 100, and bounds around it"},
    {{"mrac_adaptation_hz", "control_period_s", "controller"},
     [](const Machine& m) noexcept {
       return m.controller != ControllerName::kMrac ||
              m.mrac_adaptation_hz * m.control_period_s < 0.98F;
     },
     "mrac would change its parameters by more than themselves each period",
     "lower mrac_adaptation_hz below 1 / control_period_s; a tenth of that adapts well"},
    {{"mrac_model_time_s", "control_period_s", "controller"},
     [](const Machine& m) noexcept {
       return m.controller != ControllerName::kMrac ||
              m.mrac_model_time_s >= 0.21F * m.control_period_s;
     },
     "the force cannot follow a model that is so much faster than the control period",
     "raise mrac_model_time_s to some control periods"},
    {{"mrac_model_pole_2_hz", "mrac_model_pole_1_hz", "control_period_s", "mrac_form"},
     [](const Machine& m) noexcept {
       return m.mrac_form != MracForm::kStateError ||
              (m.mrac_model_pole_1_hz * m.control_period_s >= 0.0011F &&
               m.mrac_model_pole_2_hz >= 1.02F * m.mrac_model_pole_1_hz &&
               m.mrac_model_pole_2_hz * m.control_period_s <= 9.9F);
     },
     "the model's poles are the same, out of order, or too slow or too fast for the period",
     "give two different poles, the slower first, as 5 and 10"},
    {{"variable_gain_open_loop_1_s", "control_period_s", "override_latency_s", "controller"},
     [](const Machine& m) noexcept {
       return m.controller != ControllerName::kVariableGain || open_loop_share(m) < 0.98F;
     },
     "variable_gain is unstable with this open-loop gain",
     "lower it below 1 / override_latency_s and below 2 / control_period_s; a quarter of that is "
     "calm"},
    {{"override_latency_s", "control_period_s", "controller"},
     [](const Machine& m) noexcept {
       return m.controller != ControllerName::kPredictive ||
              m.override_latency_s <= 21.9F * m.control_period_s;
     },
     "predictive looks ahead by at most 21 control periods",
     "give the dead time in seconds (50 ms are 0.05), or a longer control period"},
    {{"predictive_calm_horizon_s", "control_period_s", "controller"},
     [](const Machine& m) noexcept {
       return m.controller != ControllerName::kPredictive ||
              m.predictive_calm_horizon_s >= 2.0F * m.control_period_s;
     },
     "predictive cannot bring the force to its reference in less than two control periods",
     "raise predictive_calm_horizon_s; 0.4 is usual"},
});

}  // namespace cutforce::firmware::detail
