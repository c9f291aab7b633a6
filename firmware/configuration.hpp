// From the machine's parameters to the checked configs of the blocks. Everything that is derived
// rather than given is derived here or in rating.hpp, and nowhere else.
#pragma once

#include <cstdint>
#include <expected>

#include "firmware/configuration_control.hpp"
#include "firmware/configuration_derived.hpp"
#include "firmware/configuration_estimator.hpp"
#include "firmware/configuration_path.hpp"
#include "firmware/control_loop.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware {

struct ConfigurationFailure {
  ConfigurationError error;
  ControlLoop::ConfigError block;  // for kBlock
};

[[nodiscard]] std::expected<ControlLoop::Config, ConfigurationError> make_loop_config(
    const Machine& machine) noexcept;

// The two steps of make_loop_config, for who can take them at compile time or has no stack for a
// second copy: whether there is an answer, and the answer.
[[nodiscard]] constexpr std::expected<void, ConfigurationError> check_loop(
    const Machine& m) noexcept {
  if (const auto derived = from_machine::derive(m); !derived)
    return std::unexpected{derived.error()};
  return {};
}

[[nodiscard]] constexpr ControlLoop::Config loop_config(const Machine& m) noexcept {
  const from_machine::Derived d = *from_machine::derive(m);
  const from_machine::Derived motor = from_machine::for_motor(m, d);
  const std::uint32_t samples = d.samples_per_estimate * d.estimates_per_control;
  return {
      .estimator = m.estimator,
      .control = m.controller != ControllerName::kNone,
      .current_w_present = m.current_w_present,
      .samples_per_estimate = d.samples_per_estimate,
      .estimates_per_control = d.estimates_per_control,
      .fixed_diameter_m = m.workpiece_diameter_m,
      .dynamometer_sigma_n = 0.01F * (m.force_reference_n > 0.0F ? m.force_reference_n : 500.0F),
      .rated_torque_nm = m.rated_torque_nm,
      .voltage_lead_s = m.voltage_lead_s,
      .force_minimum_speed_rad_s = m.minimum_speed_rad_s,
      .programmed_speed_rad_s = m.programmed_speed_rad_s,
      .gate = from_machine::gate(m, d),
      .front_end = from_machine::front_end(m),
      .health = from_machine::health(m, motor),
      .calibration = {.sample_period_s = motor.sample_period_s,
                      .shortest_s = 0.15F,
                      .shortest_periods = 4.0F,
                      .gain_limit_ratio = 0.05F,
                      .three_currents = m.current_w_present},
      .fused = from_machine::fused(m, motor),
      .path = from_machine::torque_path(m, motor),
      .load_friction = {.linear_ratio = {.speed_rad_s = m.load_friction_speed_rad_s,
                                         .value = m.load_friction_ratio},
                        .quadratic_1_nm = {.speed_rad_s = m.load_friction_speed_rad_s,
                                           .value = m.load_friction_1_nm}},
      .force = {.gear_ratio = m.gear_ratio,
                .minimum_speed_rad_s = m.minimum_speed_rad_s,
                .diameter_sigma_m = 0.0F},
      .controller = control_path_config(m, d.sample_period_s * static_cast<float>(samples))};
}

// `machine` must be complete (complete_from_rating) and pass check(Machine).
[[nodiscard]] std::expected<ControlLoop, ConfigurationFailure> make_loop(
    const Machine& machine) noexcept;

}  // namespace cutforce::firmware
