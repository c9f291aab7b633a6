// The machine that a recording was made on: from a machine file where there is one, the recording's
// metadata, its columns, the command line, and what the rating implies.
#pragma once

#include <expected>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "firmware/host/machine_file.hpp"
#include "hal/host/input_error.hpp"
#include "hal/host/recording_columns.hpp"
#include "hal/host/recording_stream.hpp"

namespace cutforce::firmware::host {

struct MachineRequest {
  std::filesystem::path machine_file;  // empty: none
  std::vector<MachineOption> options;
};

// Fails with every error found: in the machine file, the metadata or the options, a rating that is
// missing, or a sample rate in the machine file that is not the recording's.
[[nodiscard]] std::expected<LoadedMachine, std::vector<InputError>> recorded_machine(
    const hal::host::RecordingInfo& info, const hal::host::SamplePeriod& period,
    const MachineRequest& request);

// The machine of a file and options alone.
[[nodiscard]] std::expected<LoadedMachine, std::vector<InputError>> requested_machine(
    const MachineRequest& request);

// The parameters as metadata of a recording: what it needs to be replayed without a machine file.
[[nodiscard]] std::vector<hal::host::Metadata> machine_metadata(const Machine& machine);

}  // namespace cutforce::firmware::host
