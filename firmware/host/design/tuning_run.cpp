#include "firmware/host/design/tuning_run.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "firmware/configuration.hpp"
#include "firmware/host/machine_file.hpp"
#include "firmware/machine_check.hpp"
#include "hal/host/simulation/force_machine.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::ForceMachine;
using hal::host::ForceMachineConfig;
using hal::host::Profile;

constexpr double kStart = 0.8;
constexpr double kDeeper = 1.5;
constexpr double kDepth_m = 1e-3;
constexpr double kFeed_m_s = 1e-3;
constexpr double kTurns_1_s = 10.0;

double phase_s(const LoopPlant& plant, const Wish& wish) {
  const double lags_s = plant.latency_s + plant.lag_s + plant.feed_lag_s + plant.sensor_lag_s;
  return std::ceil(std::max({3.0, 5.0 * wish.settling_s, 15.0 * (lags_s + wish.period_s)}));
}

// The override at which the plant with this gain carries the reference.
double working_pct(const LoopPlant& plant, double gain_ratio) {
  return plant.override_pct() / std::pow(gain_ratio, 1.0 / plant.exponent);
}

ForceMachineConfig simulated(const LoopPlant& plant, const Wish& wish, double gain_ratio,
                             double initial_pct, double deeper_s) {
  ForceMachineConfig config{};
  config.sample_s = wish.period_s;
  config.step_s = wish.period_s / std::max(1.0, std::round(wish.period_s / 0.002));
  config.programmed_speed_1_s = kTurns_1_s;
  config.starts_in_cut = true;
  config.feed.feed_m_s = kFeed_m_s;
  config.feed.length_m = 10.0;
  config.feed.latency_s = plant.latency_s;
  config.feed.lag_s = plant.feed_lag_s;
  config.feed.initial_override_pct = initial_pct;
  config.process.nominal_feed_m_rev = kFeed_m_s / kTurns_1_s;
  config.process.exponent = plant.exponent;
  config.process.lag_s = plant.lag_s;
  config.process.depth_m = Profile{kDepth_m};
  // F = k_s a h_0 (U / 100 %)^p is the reference at the working override.
  const double at_100_n =
      plant.reference_n * std::pow(100.0 / working_pct(plant, gain_ratio), plant.exponent);
  config.process.specific_force_n_m2 = at_100_n / (kDepth_m * config.process.nominal_feed_m_rev);
  config.process.wear_ratio =
      Profile{{0.0, 1.0}, {deeper_s, 1.0}, {deeper_s, kDeeper}, {deeper_s + 1.0, kDeeper}};
  config.sensor.lag_s = plant.sensor_lag_s;
  return config;
}

// Within 5 %, or within one and a half steps of the override where those are coarser: of a heavy
// cut at a low override a step of 1 % is 5 % of the force.
StepFigures figures(const TuningRun& run, double reference_n, double rest_pct, double from_s,
                    double to_s) {
  StepFigures out{.overshoot_ratio = 0.0, .settling_s = 0.0};
  const double band = std::max(0.05, 1.5 / rest_pct);
  for (std::size_t k = 0; k < run.time_s.size(); ++k) {
    if (run.time_s[k] <= from_s || run.time_s[k] > to_s) continue;
    const double error = run.force_n[k] / reference_n - 1.0;
    out.overshoot_ratio = std::max(out.overshoot_ratio, error);
    if (std::abs(error) > band) out.settling_s = run.time_s[k] - from_s;
  }
  // Still outside in the last tenth: it has not settled, it was passing through.
  if (out.settling_s > 0.9 * (to_s - from_s))
    out.settling_s = std::numeric_limits<double>::infinity();
  return out;
}

}  // namespace

std::optional<Machine> tuned_machine(const Proposal& proposal, const LoopPlant& plant,
                                     const Wish& wish) {
  MachineFile file{};
  file.machine = default_machine();
  bool known = set_value(file, "controller", proposal.controller, "proposal");
  for (const auto& setting : proposal.settings)
    known = known && find_parameter(setting.key) &&
            set_value(file, setting.key, setting.value, "proposal");
  if (!known) return {};
  Machine& machine = file.machine;
  const auto period_s = static_cast<float>(wish.period_s);
  const auto reference_n = static_cast<float>(plant.reference_n);
  machine.estimator = EstimatorName::kDynamometer;
  machine.sample_rate_hz = 1.0F / period_s;
  machine.estimate_period_s = period_s;
  machine.control_period_s = period_s;
  machine.force_reference_n = reference_n;
  machine.force_limit_n = 4.0F * reference_n;
  machine.cut_threshold_n = 0.12F * reference_n;
  machine.override_floor_pct = static_cast<float>(kRunFloorPct);
  machine.override_ceiling_pct = static_cast<float>(kRunCeilingPct);
  if (!check(machine) || !make_loop(machine)) return {};
  return machine;
}

TuningRun tuning_run(const Machine& machine, const LoopPlant& plant, const Wish& wish,
                     double gain_ratio) {
  const double deeper_s = phase_s(plant, wish);
  Machine own = machine;
  const auto start_pct = static_cast<float>(std::round(kStart * working_pct(plant, gain_ratio)));
  own.override_initial_pct =
      std::clamp(start_pct, own.override_floor_pct, own.override_ceiling_pct);
  auto loop = *make_loop(own);
  const auto initial_pct = static_cast<double>(own.override_initial_pct);
  auto cut = ForceMachine::make(simulated(plant, wish, gain_ratio, initial_pct, deeper_s)).value();
  TuningRun run{.gain_ratio = gain_ratio,
                .time_s = {0.0},
                .force_n = {cut.truth().force_n},
                .override_pct = {initial_pct},
                .deeper_s = deeper_s,
                .rest_pct = working_pct(plant, gain_ratio),
                .approach = {},
                .deeper = {}};
  double sent_pct = initial_pct;
  while (cut.time_s() < 2.0 * deeper_s) {
    if (const auto out = loop.step(cut.read()); out && out->control_tick)
      sent_pct = static_cast<double>(loop.command().override_pct);
    cut.set_override(sent_pct);
    for (std::uint32_t k = 0; k < cut.steps_per_sample(); ++k) {
      cut.step();
      run.time_s.push_back(cut.time_s());
      run.force_n.push_back(cut.truth().force_n);
      run.override_pct.push_back(sent_pct);
    }
  }
  run.approach = figures(run, plant.reference_n, run.rest_pct, 0.0, deeper_s);
  run.deeper = figures(run, plant.reference_n, working_pct(plant, kDeeper * gain_ratio), deeper_s,
                       2.0 * deeper_s);
  return run;
}

double settles_up_to(const Machine& machine, const LoopPlant& plant, const Wish& wish) {
  double most = 0.0;
  for (const double ratio : {1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0}) {
    const auto run = tuning_run(machine, plant, wish, ratio);
    if (!std::isfinite(run.approach.settling_s + run.deeper.settling_s)) break;
    most = ratio;
  }
  return most;
}

}  // namespace cutforce::firmware::host
