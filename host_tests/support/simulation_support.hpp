// Recordings from the simulated machine, and shared recordings to hold it against.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "hal/host/simulation/simulated_machine.hpp"

namespace cutforce::host_tests {

// Motor A up to speed, loaded with 40 % of its rated torque from 1 s to 1.6 s.
[[nodiscard]] hal::host::SimulatedMachineConfig loaded_motor_a();

// One delivered sample and what was true at that instant.
struct Row {
  hal::Sample sample;
  hal::host::MachineTruth truth;

  [[nodiscard]] double time_s() const { return static_cast<double>(sample.time_ns) * 1e-9; }
};

// Open loop from time 0 to the end. Aborts the test if the config is refused.
[[nodiscard]] std::vector<Row> run_open_loop(const hal::host::SimulatedMachineConfig& config,
                                             double duration_s);

// The same as a recording file (INTERFACES, section 1), with truth columns.
void write_recording(const hal::host::SimulatedMachineConfig& config, double duration_s,
                     const std::filesystem::path& path);

// Columns by name of a shared recording, e.g. "induction_motor_sim/c01_avg_5k.csv.gz"; nothing
// where the shared recordings are absent.
using Columns = std::map<std::string, std::vector<double>, std::less<>>;
[[nodiscard]] std::optional<Columns> shared_recording(const std::string& name);

[[nodiscard]] hal::host::Complex voltage_of(const hal::Sample& sample);
[[nodiscard]] hal::host::Complex current_of(const hal::Sample& sample);

}  // namespace cutforce::host_tests
