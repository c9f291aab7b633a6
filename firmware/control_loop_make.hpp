// How the loop is made from its config, so that the compiler can do it: a board whose machine is
// compiled in starts from a constant (firmware/cortex_m/main.cpp).
#pragma once

#include <cstdint>
#include <expected>

#include "control/override_code.hpp"
#include "firmware/control_loop.hpp"

namespace cutforce::firmware {

constexpr ControlLoop::ControlLoop(const Config& config) noexcept
    : config_{.estimator = config.estimator,
              .control = config.control,
              .current_w_present = config.current_w_present,
              .sensorless = config.fused.sensorless,
              .calibrates = config.fused.calibrate,
              .estimates_per_control = config.estimates_per_control,
              .close_at_periods = static_cast<float>(config.samples_per_estimate) - 0.5F,
              .sample_period_s = config.gate.sample_period_s,
              .tick_period_s = config.health.tick_period_s,
              .dynamometer_sigma_n = config.dynamometer_sigma_n,
              .dynamometer_cut_n =
                  config.controller.cut_state.on_ratio * config.controller.force_reference_n,
              .voltage_lead_s = config.voltage_lead_s,
              .force_minimum_speed_rad_s = config.force_minimum_speed_rad_s,
              .programmed_speed_rad_s = config.programmed_speed_rad_s,
              .fused_pole_pairs = config.fused.flux.pole_pairs,
              .path_pole_pairs = config.path.synchronous.pole_pairs},
      gate_(*estimator::SampleGate::make(config.gate)),
      front_end_(*estimator::FrontEnd::make(config.front_end)),
      fused_(estimator::FusedObserver::make_checked(config.fused)),
      health_(estimator::SignalHealth::make_checked(config.health)),
      calibration_(*estimator::IdleCalibration::make(config.calibration)),
      path_(estimator::TorquePath::make_checked(config.path)),
      load_friction_(*estimator::LoadFriction::make(config.load_friction)),
      force_(*estimator::CuttingForce::make(config.force)),
      controller_(control::ControlPath::make_checked(config.controller)) {
  own_.diameter_m = config.fixed_diameter_m;
  const auto neutral =
      static_cast<std::uint8_t>(config.controller.feed_override.initial_pct + 0.5F);
  command_ = {.time_ns = 0,
              .override_pct = neutral,
              .override_code = control::encode(config.controller.code, neutral),
              .controlling = false};
}

constexpr auto ControlLoop::Config::check() const noexcept -> std::expected<void, ConfigError> {
  const auto fail = [](ConfigError error) { return std::unexpected{error}; };
  if (samples_per_estimate < 1 || estimates_per_control < 1) {
    return fail(ConfigError::kPeriods);
  }
  if (!gate.check()) return fail(ConfigError::kGate);
  if (!front_end.check()) return fail(ConfigError::kFrontEnd);
  if (!health.check()) return fail(ConfigError::kHealth);
  if (!calibration.check()) return fail(ConfigError::kCalibration);
  if (!fused.check()) return fail(ConfigError::kFused);
  if (!path.check()) return fail(ConfigError::kTorquePath);
  if (!load_friction.check()) return fail(ConfigError::kLoadFriction);
  if (!force.check()) return fail(ConfigError::kCuttingForce);
  if (!controller.check()) return fail(ConfigError::kControl);
  return {};
}

}  // namespace cutforce::firmware
