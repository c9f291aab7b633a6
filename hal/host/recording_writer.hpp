// Writes a recording, INTERFACES.md section 1: as CSV, gzip CSV (.gz) or in the binary form (.cfr,
// .cfr.gz), told by the name. The file is there when finish() has succeeded, and not before.
//
// Numbers are the shortest that read back as the same float; times are exact; a value that a row
// does not have, or that is not finite, is an empty cell.
#pragma once

#include <cstdint>
#include <expected>
#include <filesystem>
#include <span>
#include <variant>
#include <vector>

#include "hal/host/binary_recording.hpp"
#include "hal/host/input_error.hpp"
#include "hal/host/recording_columns.hpp"
#include "hal/host/text_rows.hpp"
#include "hal/host/truth.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::host {

struct RecordingLayout {
  std::vector<Metadata> metadata;  // line numbers are not written to text
  VoltageKind voltage_kind;
  std::uint32_t signals;  // bit(Signal) of each that gets a column; voltages, i_u and i_v always do
  std::uint32_t truths;   // bit(TruthSignal) of each that gets a column
};

class RecordingWriter {
 public:
  // Fails iff the file cannot be made, or a metadata key or value would not read back as it is (not
  // UTF-8, more than a line, spaces around it, a key with a colon).
  [[nodiscard]] static std::expected<RecordingWriter, InputError> create(
      const std::filesystem::path& path, const RecordingLayout& layout);

  // `truths` is as long as `samples`, or empty where the layout has none. Times increase from row
  // to row. Fails iff the file does, or a time does not increase.
  [[nodiscard]] std::expected<void, InputError> write(std::span<const Sample> samples,
                                                      std::span<const Truth> truths = {});
  [[nodiscard]] std::expected<void, InputError> finish();

 private:
  using Rows = std::variant<TextRows, BinaryRowsWriter>;

  RecordingWriter(Rows rows, std::vector<Column> columns, std::string file);
  std::expected<void, InputError> write_text(TextRows& rows, const Sample& sample,
                                             const Truth& truth) const;

  Rows rows_;
  std::vector<Column> columns_;
  std::string file_;
  std::int64_t last_time_ns_ = INT64_MIN;
};

// The same recording in the form that the name of `to` tells; unknown columns are left behind.
// Fails as the reader or the writer does, and then leaves no file.
[[nodiscard]] std::expected<void, InputError> convert_recording(const std::filesystem::path& from,
                                                                const std::filesystem::path& to);

}  // namespace cutforce::hal::host
