// A recording as the firmware may see it: samples, and what is written about them. INTERFACES.md
// section 1, from .csv, .csv.gz or .cfr (told by the first bytes, not by the name).
//
// Truth is not reachable from here: it has a reader and a type of its own (truth_reader.hpp). Rows
// are streamed; memory does not grow with the recording. Time is exact to the nanosecond; an empty
// cell is a value that this row does not have.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "hal/host/input_error.hpp"
#include "hal/host/recording_columns.hpp"
#include "hal/host/recording_stream.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::host {

class RecordingReader {
 public:
  // Reads the first rows already, so that most of what is wrong shows before anything is written.
  // Fails iff the file cannot be opened; is empty, no UTF-8 text, or has another first line; a
  // required column is missing, doubled, or of both kinds of voltage; or there is no sound first
  // row.
  [[nodiscard]] static std::expected<RecordingReader, InputError> open(
      const std::filesystem::path& path);

  [[nodiscard]] const std::string& file() const noexcept { return stream_.info().file; }
  [[nodiscard]] const std::vector<Metadata>& metadata() const noexcept {
    return stream_.info().metadata;
  }
  [[nodiscard]] const std::vector<std::string>& columns() const noexcept {
    return stream_.info().columns;
  }
  [[nodiscard]] VoltageKind voltage_kind() const noexcept { return stream_.info().voltage_kind; }

  // Whether the recording has a column for it; a single row may still lack the value.
  [[nodiscard]] bool has(Signal signal) const noexcept {
    return (stream_.info().signals & bit(signal)) != 0;
  }

  // Fails iff sample_rate_hz is no positive number, or neither it nor a second row is there.
  [[nodiscard]] std::expected<SamplePeriod, InputError> sample_period() const {
    return stream_.sample_period();
  }

  // Fills the front of `block` and returns how many rows, 0 at the end. Fails iff the next row is
  // not sound (text, NaN or infinity in a number, wrong number of cells, time that does not
  // increase, a line over 64 KiB, no UTF-8) or the file is damaged; rows before it come first.
  [[nodiscard]] std::expected<std::size_t, InputError> read(std::span<Sample> block);

 private:
  explicit RecordingReader(RecordingStream stream) : stream_(std::move(stream)) {}

  RecordingStream stream_;
};

}  // namespace cutforce::hal::host
