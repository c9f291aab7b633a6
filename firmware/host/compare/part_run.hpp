// One part cut once: the force machine, and whoever decides the override, tick by tick.
#pragma once

#include <functional>
#include <utility>

#include "firmware/host/compare/part.hpp"
#include "firmware/host/compare/part_metrics.hpp"

namespace cutforce::firmware::host {

// Once a control tick: the sample that was read, and the machine as it is (for oracles; a
// controller looks at the sample alone). The answer is what is sent, in per cent.
using Decide = std::function<double(const hal::Sample&, const hal::host::ForceMachine&)>;

struct PartLimits {
  double reference_n = 500.0;
  double ceiling_pct = 200.0;
};

// `watch(const ForceMachine&)` sees every step.
template <class Watch>
[[nodiscard]] PartMetrics run_part(const Part& part, const PartLimits& limits, const Decide& decide,
                                   Watch&& watch) {
  auto machine = hal::host::ForceMachine::make(part.machine).value();
  const double gain = part.machine.sensor.gain_ratio;
  PartScore score({.reference_n = limits.reference_n,
                   .ceiling_pct = limits.ceiling_pct,
                   .step_s = part.machine.step_s,
                   .mean_s = part.mean_s,
                   .settle_from_m = part.settle_from_m,
                   .settle_to_m = part.settle_to_m});
  while (!machine.at_end() && machine.time_s() < part.time_limit_s) {
    const double sent_pct = decide(machine.read(), machine);
    machine.set_override(sent_pct);
    score.sent(sent_pct);
    for (std::uint32_t k = 0; k < machine.steps_per_sample() && !machine.at_end(); ++k) {
      machine.step();
      const auto truth = machine.truth();
      score.step({.time_s = truth.time_s,
                  .force_n = gain * truth.force_n,
                  .position_m = truth.position_m,
                  .override_pct = truth.override_pct,
                  .in_cut = truth.depth_m > 0.0});
      watch(std::as_const(machine));
    }
  }
  return score.metrics(machine.at_end());
}

[[nodiscard]] inline PartMetrics run_part(const Part& part, const PartLimits& limits,
                                          const Decide& decide) {
  return run_part(part, limits, decide, [](const hal::host::ForceMachine&) {});
}

}  // namespace cutforce::firmware::host
