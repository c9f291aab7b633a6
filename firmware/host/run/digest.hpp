// A run of the loop as two hashes, to be held against the same run on another machine, and its
// samples as the other machine reads them.
#pragma once

#include <cstdint>
#include <expected>
#include <filesystem>
#include <string>
#include <vector>

#include "firmware/host/machine_file.hpp"
#include "firmware/loop_digest.hpp"
#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

struct DigestRequest {
  std::filesystem::path file;  // a recording, or a scenario, whose loop is closed here
  std::vector<MachineOption> options{};
  std::filesystem::path stream{};  // hal/sample_stream.hpp; empty: none is written
};

struct DigestResult {
  LoopDigest digest;
  std::uint64_t samples;
};

// Fails with every error found; then no stream is left.
[[nodiscard]] std::expected<DigestResult, std::vector<InputError>> digest_of(
    const DigestRequest& request);

}  // namespace cutforce::firmware::host
