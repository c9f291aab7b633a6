// The predictive law on its control path, and the lathe that the laws are compared on: depth over
// position, 400 N a mm at 100 %, exponent 0.864, feed that moves 25 to 45 ms after the byte.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

#include "control/control_path.hpp"
#include "control/predictive.hpp"
#include "firmware/host/compare/part.hpp"
#include "hal/host/simulation/force_machine.hpp"

namespace cutforce::host_tests {

using PredictivePath = control::BasicControlPath<control::Predictive>;

inline constexpr control::Predictive::Config kPredictiveLathe{
    .period_s = 0.05F,
    .latency_s = 0.035F,
    .latency_sigma_s = 0.0058F,  // 20 ms of scan
    .feed_lag_s = 0.03F,
    .process_lag_s = 0.1F,
    .sensor_lag_s = 0.031F,
    .feed_exponent = 0.864F,
    .process_gain_n = 400.0F,
    .noise_ratio = 0.02F,
    .noise_n = 4.0F,
    .jump_threshold = 4.2F,
    .calm_horizon_s = 0.4F,
    .recovery_1_s = 1.081F,
    .caution_ratio = 0.3263F,
    .floor_pct = 20.0F,
    .ceiling_pct = 200.0F,
    .step_pct = 1,
    .learns = false,
    .finds_latency = false,
};

[[nodiscard]] constexpr PredictivePath::Config predictive_path(
    const control::Predictive::Config& law) {
  return {.force_reference_n = 500.0F,
          .approach_pct = law.ceiling_pct,
          .neutral_pct = 100.0F,
          .fallback_pct = 70.0F,
          .fall_pct_s = 5.0F,
          .code = control::OverrideCode::kBinary,
          .force_input = {.stale_ticks = 2,
                          .hold_ticks = 4,
                          .recover_ticks = 2,
                          .negative_tolerance_n = 50.0F,
                          .highest_n = 50000.0F},
          .cut_state = {.period_s = law.period_s,
                        .on_ratio = 0.13F,
                        .off_ratio = 0.10F,
                        .entry_s = 0.15F,
                        .lost_s = 0.5F,
                        .drop_ratio = 0.1F},
          .law = law,
          .feed_override = {.period_s = law.period_s,
                            .floor_pct = law.floor_pct,
                            .ceiling_pct = law.ceiling_pct,
                            .step_pct = law.step_pct,
                            .hysteresis_pct = 0.0F,
                            .slew_up_pct_s = 1e6F,
                            .slew_down_pct_s = 1e6F,
                            .initial_pct = 100.0F},
          .applied_override = {
              .delay_ticks = 4, .confirm_ticks = 3, .tolerance_pct = 1.0F, .initial_pct = 100}};
}

// A part whose depth is this over position; 1e-3 of the profile's value is a millimetre.
[[nodiscard]] inline hal::host::ForceMachineConfig lathe_part(hal::host::Profile depth_m,
                                                              double length_m) {
  auto machine = firmware::host::comparison_lathe();
  machine.process.depth_m = std::move(depth_m);
  machine.feed.length_m = length_m;
  return machine;
}

inline void add_noise(hal::host::ForceMachineConfig& machine, std::uint64_t seed,
                      double ratio = 0.02) {
  machine.seed = seed;
  machine.sensor.noise_ratio = ratio;
  machine.sensor.noise_n = 4.0;
  machine.sensor.noise_correlation_s = machine.sensor.lag_s;
}

struct LatheTick {
  hal::host::ForceMachine::Truth before;  // when the force was read
  PredictivePath::Output output;
  double peak_n;  // of the true force until the next tick
};

// Until the end of the part or of the time. Every part begins with `part_start`.
inline std::vector<LatheTick> cut(PredictivePath& path, const hal::host::ForceMachineConfig& part,
                                  double limit_s) {
  auto machine = hal::host::ForceMachine::make(part).value();
  std::vector<LatheTick> ticks;
  while (!machine.at_end() && machine.time_s() < limit_s) {
    const auto sample = machine.read();
    const auto before = machine.truth();
    const double programmed_rad_s =
        2.0 * std::numbers::pi * part.gear_ratio * part.programmed_speed_1_s;
    const double speed =
        part.speed_present ? static_cast<double>(sample.speed_rad_s) / programmed_rad_s : 1.0;
    const auto output = path.step({.force_n = sample.measured_force_n,
                                   .force_sigma_n = 4.0F,  // noise below zero is no fault
                                   .force_age_ticks = 0,
                                   .override_reported_pct = 0.0F,
                                   .spindle_ratio = static_cast<float>(speed),
                                   .force_valid = true,
                                   .override_reported = false,
                                   .permission = control::kEverything,
                                   .part_start = ticks.empty()});
    machine.set_override(output.override_pct);
    double peak_n = 0.0;
    for (std::uint32_t k = 0; k < machine.steps_per_sample() && !machine.at_end(); ++k) {
      machine.step();
      peak_n = std::max(peak_n, machine.truth().force_n);
    }
    ticks.push_back({.before = before, .output = output, .peak_n = peak_n});
  }
  return ticks;
}

}  // namespace cutforce::host_tests
