// A scenario in closed loop: the simulated machine, the firmware's own loop, and the files of the
// run. All files are there in the end, or none.
#pragma once

#include <expected>
#include <filesystem>
#include <string_view>
#include <vector>

#include "firmware/host/run/figure.hpp"
#include "firmware/host/scenario/scenario.hpp"
#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

struct SimulationFiles {
  std::string_view recording = "recording.csv.gz";
  std::string_view trace = "trace.csv";
  std::string_view machine = "machine.toml";
  std::string_view summary = "summary.json";
};
inline constexpr SimulationFiles kSimulationFiles{};

struct SimulationResult {
  RunSummary summary;
  std::filesystem::path report;
  bool refused = false;  // the run ends with its signals refused
};

// Writes the recording with its truth, the trace at the estimate's rate, the machine file that the
// firmware was given, summary.json and report.html. `compare`: other estimators that see the same
// samples without a say in the override, each with a trace named after it.
// Fails iff the scenario's machines are refused or a file cannot be written. Throws Stopped.
[[nodiscard]] std::expected<SimulationResult, std::vector<InputError>> simulate(
    const Scenario& scenario, const std::filesystem::path& folder,
    std::span<const EstimatorName> compare);

// The recording alone, in the form that its name tells.
[[nodiscard]] std::expected<void, std::vector<InputError>> simulate_recording(
    const Scenario& scenario, const std::filesystem::path& recording);

}  // namespace cutforce::firmware::host
