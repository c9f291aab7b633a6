// Reads a trace as TraceWriter writes it, plain or gzip, streaming; columns in any order, unknown
// ones ignored. A trace does not say which rows end a control period: control_tick is false.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/host/trace_format.hpp"
#include "firmware/loop_output.hpp"
#include "hal/host/input_error.hpp"
#include "hal/host/line_reader.hpp"

namespace cutforce::firmware::host {

class TraceReader {
 public:
  // Fails iff the file cannot be opened, is empty or no text, has another first line, or lacks or
  // doubles a column.
  [[nodiscard]] static std::expected<TraceReader, hal::host::InputError> open(
      const std::filesystem::path& path);

  // Fills the front of `block` and returns how many rows, 0 at the end; a trace may have none.
  // Fails iff the next row has a cell that is not what its column holds, a wrong number of cells,
  // or a time that does not increase, or the file is damaged; rows before it come first. A sigma
  // that is not given is infinite.
  [[nodiscard]] std::expected<std::size_t, hal::host::InputError> read(std::span<LoopOutput> block);

 private:
  TraceReader(hal::host::LineReader lines, std::vector<const TraceColumn*> columns);

  std::optional<hal::host::InputError> read_row(LoopOutput& output);
  std::optional<hal::host::InputError> read_cell(const TraceColumn& column, std::string_view cell,
                                                 LoopOutput& output);
  std::optional<hal::host::InputError> read_number_cell(const TraceColumn& column,
                                                        std::string_view cell, LoopOutput& output);
  hal::host::InputError wrong(const TraceColumn& column, std::string_view cell,
                              std::string_view why) const;
  hal::host::InputError refused(std::string_view cell, std::string what, std::string remedy) const;

  hal::host::LineReader lines_;
  std::vector<const TraceColumn*> columns_;  // null: unknown, ignored
  std::int64_t last_time_ns_ = INT64_MIN;
  std::optional<hal::host::InputError> failed_;
};

}  // namespace cutforce::firmware::host
