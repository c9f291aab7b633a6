// The rows of a recording in whatever form it is stored: what the text and the binary form share.
#pragma once

#include <cstddef>
#include <expected>
#include <span>

#include "hal/host/input_error.hpp"
#include "hal/host/recording_columns.hpp"
#include "hal/host/truth.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::host {

class RowSource {
 public:
  RowSource() = default;
  RowSource(const RowSource&) = delete;
  RowSource& operator=(const RowSource&) = delete;
  virtual ~RowSource() = default;

  [[nodiscard]] virtual const RecordingInfo& info() const noexcept = 0;

  // Fills the front of both spans, which are of the same length, and returns how many rows; 0 at
  // the end. Rows before a fault are delivered first; the fault then comes with every later call.
  [[nodiscard]] virtual std::expected<std::size_t, InputError> read(std::span<Sample> samples,
                                                                    std::span<Truth> truths) = 0;
};

}  // namespace cutforce::hal::host
