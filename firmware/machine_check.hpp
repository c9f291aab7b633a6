// What must hold between parameters, after each is within its own range. The same rules check a
// machine file on the host and a machine compiled into an image (constexpr).
#pragma once

#include <expected>

#include "firmware/machine_check_control.hpp"
#include "firmware/machine_check_supervisor.hpp"

namespace cutforce::firmware {

namespace detail {

[[nodiscard]] constexpr bool increases(const std::array<float, 3>& values) noexcept {
  return values[0] < values[1] && values[1] < values[2];
}

[[nodiscard]] constexpr bool none_is_zero(const std::array<float, 3>& values) noexcept {
  return values[0] != 0.0F && values[1] != 0.0F && values[2] != 0.0F;
}

// Peak voltage between the points that are measured, of a sine at rated voltage: sqrt(2) or
// sqrt(2/3) times the rms between lines.
[[nodiscard]] constexpr float rated_peak_voltage_v(const Machine& m) noexcept {
  return m.rated_voltage_v_rms *
         (m.voltage_kind == VoltageKind::kLineToLine ? 1.4142136F : 0.8164966F);
}

// 1 where shaft speed and synchronous speed agree; 0 if the rating does not say. (F4)
[[nodiscard]] constexpr float rated_slip_ratio(const Machine& m) noexcept {
  if (!(m.rated_power_w > 0 && m.rated_torque_nm > 0 && m.rated_frequency_hz > 0)) return 0.0F;
  const float synchronous_rad_s = 6.2831853F * m.rated_frequency_hz / m.pole_pairs;
  return 1.0F - m.rated_power_w / m.rated_torque_nm / synchronous_rad_s;
}

[[nodiscard]] constexpr bool power_is_torque_times_speed(const Machine& m) noexcept {
  if (!(m.rated_power_w > 0 && m.rated_torque_nm > 0 && m.rated_speed_rad_s > 0)) return true;
  const float ratio = m.rated_torque_nm * m.rated_speed_rad_s / m.rated_power_w;
  return ratio > 0.95F && ratio < 1.05F;
}

// Efficiency times power factor of any motor in use lies within.
[[nodiscard]] constexpr bool power_fits_voltage_and_current(const Machine& m) noexcept {
  if (!(m.rated_power_w > 0 && m.rated_voltage_v_rms > 0 && m.rated_current_a_rms > 0)) return true;
  const float ratio =
      m.rated_power_w / (1.7320508F * m.rated_voltage_v_rms * m.rated_current_a_rms);
  return ratio > 0.25F && ratio < 1.0F;
}

// Drop over the stator resistance at rated current, as a part of the rated phase voltage.
[[nodiscard]] constexpr bool resistance_fits_rating(const Machine& m) noexcept {
  if (!(m.stator_resistance_ohm > 0 && m.rated_voltage_v_rms > 0)) return true;
  const float star_ohm = m.stator_resistance_ohm / (m.winding == Winding::kDelta ? 3.0F : 1.0F);
  const float drop = 1.7320508F * star_ohm * m.rated_current_a_rms / m.rated_voltage_v_rms;
  return !(drop > 0.0F) || (drop > 0.001F && drop < 0.3F);
}

// Seconds that the rated torque needs to reach the rated speed.
[[nodiscard]] constexpr bool inertia_fits_rating(const Machine& m) noexcept {
  if (!(m.rated_torque_nm > 0)) return true;
  const float run_up_s = m.inertia_kg_m2 * m.rated_speed_rad_s / m.rated_torque_nm;
  return !(run_up_s > 0.0F) || (run_up_s > 0.001F && run_up_s < 60.0F);
}

}  // namespace detail

namespace detail {

inline constexpr auto kMotorRules = std::to_array<MachineRule>({
    {{"voltage_gain_ratio"},
     [](const Machine& m) noexcept { return detail::none_is_zero(m.voltage_gain_ratio); },
     "a gain of 0 removes the channel",
     "give the gain of each channel, 1 if unknown"},
    {{"current_gain_ratio"},
     [](const Machine& m) noexcept { return detail::none_is_zero(m.current_gain_ratio); },
     "a gain of 0 removes the channel",
     "give the gain of each channel, 1 if unknown"},
    {{"voltage_limit_v", "rated_voltage_v_rms", "voltage_kind"},
     [](const Machine& m) noexcept { return m.voltage_limit_v > detail::rated_peak_voltage_v(m); },
     "the motor's own voltage, at its peak, is beyond the limit",
     "give the limit as a peak, not rms: the end of the sensor's range, above 1.42 times the rated "
     "voltage for line-to-line samples and 0.82 times for line-to-neutral ones"},
    {{"current_limit_a", "rated_current_a_rms"},
     [](const Machine& m) noexcept {
       return m.current_limit_a > 1.4142136F * m.rated_current_a_rms;
     },
     "the motor's own current, at its peak, is beyond the limit",
     "give the limit as a peak, not rms: the end of the sensor's range, above 1.42 times the rated "
     "current"},
    {{"speed_limit_rad_s", "rated_speed_rad_s"},
     [](const Machine& m) noexcept { return m.speed_limit_rad_s > m.rated_speed_rad_s; },
     "the rated speed is beyond the limit",
     "give the highest motor speed in rad/s, with a margin"},
    {{"power_limit_w", "rated_power_w"},
     [](const Machine& m) noexcept { return m.power_limit_w > m.rated_power_w; },
     "the rated power is beyond the limit",
     "give the end of the power meter's range in W"},
    {{"minimum_speed_rad_s", "speed_limit_rad_s"},
     [](const Machine& m) noexcept { return m.minimum_speed_rad_s < m.speed_limit_rad_s; },
     "no speed is left for an estimate",
     "lower minimum_speed_rad_s"},
    {{"iron_loss_w", "iron_loss_declared"},
     [](const Machine& m) noexcept { return m.iron_loss_declared || m.iron_loss_w == 0.0F; },
     "an iron loss is given and declared unknown",
     "leave iron_loss_declared out, or set it to true"},
    {{"rated_power_w", "rated_torque_nm", "rated_speed_rad_s"},
     &detail::power_is_torque_times_speed,
     "power is not torque times speed",
     "correct one of the three, or leave one out: power in W, torque in N m, speed in rad/s (rpm "
     "times 0.10472)"},
    {{"pole_pairs", "rated_frequency_hz", "rated_power_w", "rated_torque_nm"},
     [](const Machine& m) noexcept {
       const float slip = detail::rated_slip_ratio(m);
       return slip > -0.01F && slip < 0.2F;
     },
     "the rated speed, power over torque, does not go with frequency and pole pairs",
     "check that pole_pairs is half the number of poles, and the rated values against the name "
     "plate"},
    {{"rated_current_a_rms", "rated_voltage_v_rms", "rated_power_w"},
     &detail::power_fits_voltage_and_current,
     "power does not go with voltage and current",
     "give the line current and the line-to-line voltage in rms, as the name plate does"},
    {{"stator_resistance_ohm", "rated_voltage_v_rms", "rated_current_a_rms", "winding"},
     &detail::resistance_fits_rating,
     "at rated current this resistance would drop less than 0.1 % or more than 30 % of the voltage",
     "give the resistance of one phase in ohm (milliohm times 0.001)"},
    {{"inertia_kg_m2", "rated_torque_nm", "rated_speed_rad_s"},
     &detail::inertia_fits_rating,
     "the rated torque would run this inertia up in less than 1 ms or more than a minute",
     "give the inertia in kg m2 (kg cm2 times 1e-4, g cm2 times 1e-7)"},
    {{"load_friction_speed_rad_s"},
     [](const Machine& m) noexcept { return detail::increases(m.load_friction_speed_rad_s); },
     "the speeds do not increase",
     "give three different speeds, the lowest first"},
    {{"sample_rate_hz", "estimator"},
     [](const Machine& m) noexcept {
       return m.sample_rate_hz == 0.0F || m.sample_rate_hz >= 100.0F ||
              m.estimator == EstimatorName::kDynamometer;
     },
     "too slow for an estimate from voltages and currents",
     "sample at 1 kHz or more, at 100 Hz at least, or choose the estimator dynamometer"},
    {{"estimate_period_s", "estimator"},
     [](const Machine& m) noexcept {
       return m.estimate_period_s <= 0.1F || m.estimator == EstimatorName::kDynamometer;
     },
     "too long for an estimate from voltages and currents",
     "give 0.001, at most 0.1"},
    {{"estimate_period_s", "sample_rate_hz"},
     [](const Machine& m) noexcept {
       return m.sample_rate_hz == 0.0F || m.estimate_period_s < estimate_period_s(m) ||
              detail::is_multiple(m.estimate_period_s, 1.0F / m.sample_rate_hz);
     },
     "the estimate period is not a whole number of samples",
     "give a multiple of 1 / sample_rate_hz"},
    {{"control_period_s", "estimate_period_s"},
     [](const Machine& m) noexcept {
       return m.estimate_period_s < estimate_period_s(m) ||
              detail::is_multiple(m.control_period_s, m.estimate_period_s);
     },
     "the control period is not a whole number of estimate periods",
     "give a multiple of estimate_period_s"},
    {{"control_period_s", "sample_rate_hz"},
     [](const Machine& m) noexcept {
       return !(m.estimate_period_s < estimate_period_s(m)) ||
              detail::is_multiple(m.control_period_s, 1.0F / m.sample_rate_hz);
     },
     "the control period is not a whole number of samples",
     "give a multiple of 1 / sample_rate_hz"},
    {{"estimator", "power_meter_present"},
     [](const Machine& m) noexcept {
       return m.power_meter_present || (m.estimator != EstimatorName::kMeasured &&
                                        m.estimator != EstimatorName::kSynthesized);
     },
     "this estimator needs the power meter",
     "choose computed or fused"},
    {{"speed_source", "speed_present", "estimator"},
     [](const Machine& m) noexcept {
       return m.speed_present || m.speed_source != SpeedSource::kRotor ||
              m.estimator == EstimatorName::kFused || m.estimator == EstimatorName::kDynamometer;
     },
     "the rotor's speed is not measured",
     "choose speed_source = \"synchronous\" or \"slip\""},
});

}  // namespace detail

inline constexpr auto kMachineRules = detail::joined(
    detail::kMotorRules, detail::joined(detail::kControlRules, detail::kSupervisorRules));

// Every value within its range and every rule kept; the error is the key to blame.
[[nodiscard]] constexpr std::expected<void, std::string_view> check(
    const Machine& machine) noexcept {
  for (const Parameter& parameter : kParameters) {
    for (std::size_t k = 0; k < parameter.size(); ++k) {
      if (!parameter.allows(parameter.get(machine, k))) return std::unexpected{parameter.key};
    }
  }
  for (const MachineRule& rule : kMachineRules) {
    if (!rule.holds(machine)) return std::unexpected{rule.keys[0]};
  }
  return {};
}

}  // namespace cutforce::firmware
