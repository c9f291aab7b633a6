#include "firmware/host/run/simulate.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "firmware/host/report/report.hpp"
#include "firmware/host/run/loop_recorder.hpp"
#include "firmware/host/run/output_folder.hpp"
#include "firmware/host/run/simulated_run.hpp"
#include "firmware/host/run/truth_score.hpp"
#include "firmware/host/write_file.hpp"

namespace cutforce::firmware::host {
namespace {

namespace fs = std::filesystem;
using Errors = std::vector<InputError>;
using hal::host::ForceMachine;
using hal::host::ForceMachinePort;
using hal::host::RecordingWriter;
using hal::host::SimulatedMachine;
using hal::host::SimulationPort;

constexpr TraceRows kEveryEstimate{.control_ticks = false, .every_nth = 1};
constexpr TraceRows kControlTicks{.control_ticks = true};

std::string name_of(EstimatorName estimator) {
  return std::string(kNames<EstimatorName>[static_cast<std::size_t>(estimator)]);
}

std::string trace_name(EstimatorName estimator) { return "trace_" + name_of(estimator) + ".csv"; }

// Another estimator that watches the same samples.
struct Watcher {
  EstimatorName estimator;
  ControlLoop loop;
  LoopRecorder recorder;
};

std::expected<Watcher, InputError> watcher_for(const Scenario& scenario, EstimatorName estimator,
                                               const fs::path& folder) {
  Machine machine = scenario.machine;
  machine.estimator = estimator;
  machine.controller = ControllerName::kNone;
  auto loop = loop_for(machine, "estimator " + name_of(estimator));
  if (!loop) return std::unexpected{loop.error()};
  const bool fast = estimator == EstimatorName::kFused;
  auto recorder =
      LoopRecorder::create(folder / trace_name(estimator), fast ? kEveryEstimate : kControlTicks);
  if (!recorder) return std::unexpected{recorder.error()};
  return Watcher{estimator, *loop, std::move(*recorder)};
}

std::expected<std::vector<Watcher>, InputError> watchers_for(
    const Scenario& scenario, const fs::path& folder, std::span<const EstimatorName> compare) {
  std::vector<Watcher> watchers;
  for (const EstimatorName estimator : compare) {
    if (estimator == scenario.machine.estimator) continue;
    auto watcher = watcher_for(scenario, estimator, folder);
    if (!watcher) return std::unexpected{watcher.error()};
    watchers.push_back(std::move(*watcher));
  }
  return watchers;
}

RunSummary summarize(const Scenario& scenario, const RunStatistics& statistics,
                     const TruthScore& score, std::span<const Watcher> watchers,
                     std::uint64_t samples) {
  RunSummary summary{
      .title = scenario.title,
      .recording = std::string(kSimulationFiles.recording),
      .traces = {{name_of(scenario.machine.estimator), std::string(kSimulationFiles.trace)}},
      .figures = score.force_figures(scenario.machine),
      .events = score.events(),
      .warnings = scenario.warnings,
      .verdict = statistics.verdict(),
      .machine = scenario.machine};
  for (const Watcher& watcher : watchers) {
    summary.traces.push_back({name_of(watcher.estimator), trace_name(watcher.estimator)});
  }
  const auto append = [&summary](const std::vector<Figure>& figures) {
    summary.figures.insert(summary.figures.end(), figures.begin(), figures.end());
  };
  append(score.estimate_figures(scenario.machine));
  append(statistics.figures(scenario.machine));
  summary.figures.push_back({"samples", "Samples", static_cast<double>(samples)});
  for (const Event& event : statistics.events()) {
    summary.events.push_back({event.time_s, "loop: " + event.text});
  }
  std::ranges::stable_sort(summary.events, {}, &Event::time_s);
  return summary;
}

std::expected<fs::path, InputError> write_texts(const Scenario& scenario, const RunSummary& summary,
                                                const fs::path& folder) {
  if (auto written =
          write_file(folder / kSimulationFiles.machine, machine_file_text(scenario.machine));
      !written) {
    return std::unexpected{written.error()};
  }
  const std::string text = summary_json(summary).dump(2) + "\n";
  if (auto written = write_file(folder / kSimulationFiles.summary, text); !written) {
    return std::unexpected{written.error()};
  }
  return write_report(folder);
}

std::unexpected<Errors> failed(const InputError& error) { return std::unexpected{Errors{error}}; }

template <class Simulated>
std::expected<SimulationResult, Errors> simulate_on(Simulated& simulated, const Scenario& scenario,
                                                    const fs::path& folder,
                                                    std::span<const EstimatorName> compare) {
  auto loop = loop_for(scenario.machine, scenario.title);
  if (!loop) return failed(loop.error());
  auto made = OutputFolder::make(folder);
  if (!made) return failed(made.error());
  auto writer = RecordingWriter::create(folder / kSimulationFiles.recording, layout_of(scenario));
  if (!writer) return failed(writer.error());
  auto recorder = LoopRecorder::create(folder / kSimulationFiles.trace, kEveryEstimate);
  if (!recorder) return failed(recorder.error());
  auto watchers = watchers_for(scenario, folder, compare);
  if (!watchers) return failed(watchers.error());

  TruthScore score;
  RecordedSimulation port(simulated, scenario.duration_s, *writer,
                          [&watchers](const hal::Sample& sample) {
                            for (Watcher& watcher : *watchers) {
                              if (const auto out = watcher.loop.step(sample)) {
                                watcher.recorder.take(*out);
                              }
                            }
                          });
  hal::Sample block{};
  const auto ran = run(port, *loop, std::span(&block, 1), [&](const LoopOutput& output) {
    recorder->take(output);
    score.add(output, simulated.truth());
  });
  if (!ran && port.error()) return failed(*port.error());

  if (const auto finished = writer->finish(); !finished) return failed(finished.error());
  made->keep();
  if (const auto finished = recorder->finish(); !finished) return failed(finished.error());
  for (Watcher& watcher : *watchers) {
    if (const auto finished = watcher.recorder.finish(); !finished) return failed(finished.error());
  }
  SimulationResult result{
      .summary = summarize(scenario, recorder->statistics(), score, *watchers, port.samples()),
      .report = {},
      .refused = recorder->statistics().ends_refused()};
  auto report = write_texts(scenario, result.summary, folder);
  if (!report) return failed(report.error());
  result.report = std::move(*report);
  return result;
}

template <class Simulated>
std::expected<void, Errors> record_on(Simulated& simulated, const Scenario& scenario,
                                      const fs::path& recording) {
  auto loop = loop_for(scenario.machine, scenario.title);
  if (!loop) return failed(loop.error());
  auto made = OutputFolder::make(recording.parent_path());
  if (!made) return failed(made.error());
  auto writer = RecordingWriter::create(recording, layout_of(scenario));
  if (!writer) return failed(writer.error());
  RecordedSimulation port(simulated, scenario.duration_s, *writer, {});
  hal::Sample block{};
  const auto ran = run(port, *loop, std::span(&block, 1), [](const LoopOutput&) {});
  if (!ran && port.error()) return failed(*port.error());
  if (const auto finished = writer->finish(); !finished) return failed(finished.error());
  made->keep();
  return {};
}

// Makes the scenario's machine and hands its port to `work`, whose errors it returns with its own.
template <class Work>
auto on_machine_of(const Scenario& scenario, Work&& work)
    -> decltype(work(std::declval<SimulationPort&>())) {
  if (scenario.model == Model::kForce) {
    auto machine = ForceMachine::make(scenario.force);
    if (!machine) return failed(machine.error());
    ForceMachinePort port(*machine, scenario.duration_s);
    return work(port);
  }
  auto machine = SimulatedMachine::make(scenario.simulation);
  if (!machine) return failed(machine.error());
  SimulationPort port(*machine, static_cast<double>(scenario.machine.control_period_s),
                      scenario.duration_s);
  return work(port);
}

}  // namespace

std::expected<SimulationResult, Errors> simulate(const Scenario& scenario, const fs::path& folder,
                                                 std::span<const EstimatorName> compare) {
  return on_machine_of(scenario,
                       [&](auto& port) { return simulate_on(port, scenario, folder, compare); });
}

std::expected<void, Errors> simulate_recording(const Scenario& scenario,
                                               const fs::path& recording) {
  return on_machine_of(scenario, [&](auto& port) { return record_on(port, scenario, recording); });
}

}  // namespace cutforce::firmware::host
