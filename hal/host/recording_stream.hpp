// A recording in any of its forms, told by its first bytes: samples and, beside them, truth. What
// RecordingReader and TruthReader share; neither programs nor ports use it directly.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "hal/host/input_error.hpp"
#include "hal/host/row_source.hpp"

namespace cutforce::hal::host {

// How far apart the rows of a recording are.
struct SamplePeriod {
  double period_s;    // declared where it agrees with the rows to a tenth, else the median
  double median_s;    // of the first rows' differences; 0: there is but one row
  double declared_s;  // by the metadata sample_rate_hz; 0: not declared
};

class RecordingStream {
 public:
  static constexpr std::size_t kFirstRows = 256;

  // Reads the first rows already. Fails iff the file cannot be opened, what stands before the rows
  // is wrong, there is no row, or one of the first rows is wrong.
  [[nodiscard]] static std::expected<RecordingStream, InputError> open(
      const std::filesystem::path& path);

  [[nodiscard]] const RecordingInfo& info() const noexcept { return rows_->info(); }

  // Fails iff sample_rate_hz is no positive number, or neither it nor a second row is there.
  [[nodiscard]] std::expected<SamplePeriod, InputError> sample_period() const;

  // As RowSource::read().
  [[nodiscard]] std::expected<std::size_t, InputError> read(std::span<Sample> samples,
                                                            std::span<Truth> truths);

 private:
  RecordingStream(std::unique_ptr<RowSource> rows, std::vector<Sample> samples,
                  std::vector<Truth> truths);

  std::unique_ptr<RowSource> rows_;
  std::vector<Sample> first_samples_;
  std::vector<Truth> first_truths_;
  std::size_t first_read_ = 0;  // of them
  double median_s_ = 0.0;
};

}  // namespace cutforce::hal::host
