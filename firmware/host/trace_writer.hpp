// Writes a trace, one row for each LoopOutput; packed by gzip where the name ends in .gz. The file
// is there when finish() has succeeded, and not before.
//
// Numbers are the shortest that read back as the same float; times are exact; what does not exist,
// or is not finite, is an empty cell.
#pragma once

#include <expected>
#include <filesystem>
#include <span>

#include "firmware/loop_output.hpp"
#include "hal/host/input_error.hpp"
#include "hal/host/text_rows.hpp"

namespace cutforce::firmware::host {

class TraceWriter {
 public:
  // Each fails iff the system refuses the file.
  [[nodiscard]] static std::expected<TraceWriter, hal::host::InputError> create(
      const std::filesystem::path& path);
  [[nodiscard]] std::expected<void, hal::host::InputError> write(const LoopOutput& output);
  [[nodiscard]] std::expected<void, hal::host::InputError> write(
      std::span<const LoopOutput> outputs);
  [[nodiscard]] std::expected<void, hal::host::InputError> finish();

 private:
  explicit TraceWriter(hal::host::TextRows rows);

  hal::host::TextRows rows_;
};

}  // namespace cutforce::firmware::host
