// What each law is told, from the machine's parameters.
#pragma once

#include <algorithm>
#include <cstdint>

#include "control/law_set.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware {
namespace from_machine {

using control::LawName;

inline constexpr float kSettle_s = 2.0F;   // in the cut, until the process gain counts as settled
inline constexpr float kSoft_pct = 10.0F;  // overrides below teach less
inline constexpr float kDistinct_ratio = 0.02F;
inline constexpr float kForceRate_hz = 10.0F;  // corner of the force's rate in P2's law

[[nodiscard]] constexpr LawName in_charge(ControllerName name) noexcept {
  switch (name) {
    case ControllerName::kPid:
      return LawName::kPid;
    case ControllerName::kPoleAssignment:
      return LawName::kPoleAssignment;
    case ControllerName::kMrac:
      return LawName::kMrac;
    case ControllerName::kVariableGain:
      return LawName::kVariableGain;
    case ControllerName::kFuzzy:
      return LawName::kFuzzy;
    case ControllerName::kPredictive:
      return LawName::kPredictive;
    case ControllerName::kPi:
    case ControllerName::kNone:  // the path runs and does not control
      break;
  }
  return LawName::kPi;
}

[[nodiscard]] constexpr control::PoleAssignment::Config pole_assignment(const Machine& m,
                                                                        float period_s) noexcept {
  const float first = m.pole_assignment_pole_1_ratio;
  const float second = m.pole_assignment_pole_2_ratio;
  const bool printed = m.pole_assignment_printed_rate_1_pct > 0.0F;
  return {.period_s = period_s,
          .pole_sum = first + second,
          .pole_product = first * second,
          .estimate = {.form = printed ? control::ProcessGain::Form::kLiteral
                                       : control::ProcessGain::Form::kNormalised,
                       .literal_rate_1_pct = m.pole_assignment_printed_rate_1_pct,
                       .normalised_rate_ratio = m.pole_assignment_learning_ratio,
                       .soft_pct = kSoft_pct,
                       .initial_n_pct = m.process_gain_n_pct,
                       .least_n_pct = m.process_gain_least_n_pct,
                       .most_n_pct = m.process_gain_most_n_pct,
                       .excitation_n = m.cut_threshold_n},
          .settle_s = kSettle_s};
}

// What fits any period, where the form is not chosen: both must be sound.
[[nodiscard]] constexpr control::StateErrorMrac::Config state_error(const Machine& m,
                                                                    float period_s) noexcept {
  const bool chosen = m.mrac_form == MracForm::kStateError;
  return {.period_s = period_s,
          .model_pole_1_hz = chosen ? m.mrac_model_pole_1_hz : 0.25F / period_s,
          .model_pole_2_hz = chosen ? m.mrac_model_pole_2_hz : 0.5F / period_s,
          .plant_n_mm_s2 = m.mrac_plant_n_mm_s2,
          .state_scale_ratio = m.mrac_state_scale_ratio,
          .adaptation_ratio = m.mrac_state_gain_ratio,
          .normalised = false};
}

[[nodiscard]] constexpr control::Mrac::Config mrac(const Machine& m, float period_s) noexcept {
  const bool on_state = m.mrac_form == MracForm::kStateError;
  return {.period_s = period_s,
          .form = on_state ? control::Mrac::Form::kStateError : control::Mrac::Form::kOutputError,
          .feed_mm_s_pct = m.mrac_feed_mm_s_pct,
          .derivative_hz = std::min(kForceRate_hz, 0.5F / period_s),
          .state_error = state_error(m, period_s),
          .output_error = {.period_s = period_s,
                           .model_time_s = std::max(m.mrac_model_time_s, 0.2F * period_s),
                           .adaptation_hz = std::min(m.mrac_adaptation_hz, 0.99F / period_s),
                           .gain_lowest_n_pct = m.process_gain_least_n_pct,
                           .gain_highest_n_pct = m.process_gain_most_n_pct}};
}

[[nodiscard]] constexpr control::VariableGain::Config variable_gain(const Machine& m,
                                                                    float period_s) noexcept {
  const auto latency_ticks = static_cast<std::uint32_t>(m.override_latency_s / period_s + 0.999F);
  const float highest = latency_ticks == 0 ? 2.0F : 1.0F / static_cast<float>(latency_ticks);
  return {.period_s = period_s,
          .open_loop_1_s = std::min(m.variable_gain_open_loop_1_s, 0.99F * highest / period_s),
          .latency_ticks = latency_ticks,
          .smoothing_s = m.variable_gain_smoothing_s,
          .initial_n_pct = m.process_gain_n_pct,
          .least_n_pct = m.process_gain_least_n_pct,
          .most_n_pct = m.process_gain_most_n_pct,
          .excitation_n = m.cut_threshold_n};
}

// Two lags that are the very same have no partial fractions: one of them gives way a little.
[[nodiscard]] constexpr float apart_from(float lag_s, float other_s) noexcept {
  const float nearest_s = kDistinct_ratio * other_s;
  const float apart_s = lag_s - other_s;
  if (apart_s >= nearest_s || apart_s <= -nearest_s) return lag_s;
  return apart_s > 0.0F ? other_s + nearest_s : other_s - nearest_s;
}

// The controller sees the mean of the estimates within its period; a dynamometer's lag is its own.
[[nodiscard]] constexpr float seen_lag_s(const Machine& m, float period_s) noexcept {
  if (m.estimator == EstimatorName::kDynamometer) return m.force_lag_s;
  return m.force_lag_s + 0.5F * std::max(period_s - m.estimate_period_s, 0.0F);
}

[[nodiscard]] constexpr control::Predictive::Config predictive(const Machine& m,
                                                               float period_s) noexcept {
  constexpr auto kLongest = static_cast<float>(control::Predictive::kHistory - 2);
  return {.period_s = period_s,
          .latency_s = std::min(m.override_latency_s, 0.999F * kLongest * period_s),
          .latency_sigma_s = m.override_latency_sigma_s,
          .feed_lag_s = apart_from(m.feed_lag_s, m.process_lag_s),
          .process_lag_s = m.process_lag_s,
          .sensor_lag_s = apart_from(seen_lag_s(m, period_s), m.process_lag_s),
          .feed_exponent = m.feed_exponent_ratio,
          .process_gain_n = 100.0F * m.process_gain_n_pct,
          .noise_ratio = m.predictive_noise_ratio,
          .noise_n = m.predictive_noise_n,
          .jump_threshold = m.predictive_jump_ratio,
          .calm_horizon_s = std::max(m.predictive_calm_horizon_s, 2.0F * period_s),
          .recovery_1_s = m.predictive_recovery_1_s,
          .caution_ratio = m.predictive_caution_ratio,
          .floor_pct = m.override_floor_pct,
          .ceiling_pct = m.override_ceiling_pct,
          .step_pct = m.override_step_pct > 5.0F ? 10U : 1U,
          .learns = m.predictive_learns,
          .finds_latency = m.predictive_finds_latency};
}

}  // namespace from_machine

// Every law is sound, in charge or not. `machine` must pass check(Machine): then nothing that the
// law in charge was given is moved. What another law was given may not fit the period, for no rule
// speaks of it; that is moved to where it does.
[[nodiscard]] constexpr control::LawSet::Config law_set_config(const Machine& m,
                                                               float period_s) noexcept {
  return {.period_s = period_s,
          .in_charge = from_machine::in_charge(m.controller),
          .pi = {.period_s = period_s,
                 .form = control::PiController::Form::kVelocity,
                 .proportional_pct_n = m.pi_proportional_pct_n,
                 .integral_pct_n_s = m.pi_integral_pct_n_s,
                 .tracking_s = period_s,
                 .supervise = m.pi_supervise},
          .pid = {.period_s = period_s,
                  .proportional_pct_n = m.pid_proportional_pct_n,
                  .integral_time_s = m.pid_integral_time_s,
                  .derivative_time_s = m.pid_derivative_time_s,
                  .derivative_filter_ratio = m.pid_derivative_filter_ratio},
          .pole_assignment = from_machine::pole_assignment(m, period_s),
          .mrac = from_machine::mrac(m, period_s),
          .variable_gain = from_machine::variable_gain(m, period_s),
          .fuzzy = {.period_s = period_s,
                    .error_range_n = m.fuzzy_error_range_n,
                    .change_range_n = m.fuzzy_change_range_n,
                    .step_range_pct = m.fuzzy_step_range_pct},
          .predictive = from_machine::predictive(m, period_s)};
}

}  // namespace cutforce::firmware
