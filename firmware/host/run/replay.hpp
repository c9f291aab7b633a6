// The firmware's loop over a recording: samples in, trace out, nothing kept in between.
#pragma once

#include <expected>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "firmware/host/run/figure.hpp"
#include "firmware/host/run/recorded_machine.hpp"
#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

struct ReplayRequest {
  std::filesystem::path recording;
  std::filesystem::path trace;
  MachineRequest machine;
  std::optional<double> rate_hz{};  // rows of the trace a second; none: one each control tick
};

struct ReplayResult {
  RunSummary summary;    // paths relative to the trace's folder
  bool refused = false;  // the recording ends with its signals refused
};

// Fails with every error found; then no file is left. Throws Stopped.
[[nodiscard]] std::expected<ReplayResult, std::vector<InputError>> replay(
    const ReplayRequest& request);

// As a path of `file` seen from `folder`, where there is one; else absolute.
[[nodiscard]] std::string seen_from(const std::filesystem::path& folder,
                                    const std::filesystem::path& file);

}  // namespace cutforce::firmware::host
