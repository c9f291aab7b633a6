// A recording as evaluation and reports see it: each row's sample, and the truth beside it.
#pragma once

#include <cassert>
#include <cstddef>
#include <expected>
#include <filesystem>
#include <span>
#include <utility>

#include "hal/host/recording_stream.hpp"
#include "hal/host/truth.hpp"

namespace cutforce::hal::host {

class TruthReader {
 public:
  // Fails as RecordingReader::open() does. A recording without truth is no fault: see has().
  [[nodiscard]] static std::expected<TruthReader, InputError> open(
      const std::filesystem::path& path) {
    auto stream = RecordingStream::open(path);
    if (!stream) return std::unexpected{stream.error()};
    return TruthReader{std::move(*stream)};
  }

  [[nodiscard]] const RecordingInfo& info() const noexcept { return stream_.info(); }

  [[nodiscard]] bool has(TruthSignal signal) const noexcept {
    return (stream_.info().truths & bit(signal)) != 0;
  }

  [[nodiscard]] std::expected<SamplePeriod, InputError> sample_period() const {
    return stream_.sample_period();
  }

  // Both spans are of the same length. Fills the front of both and returns how many rows, 0 at the
  // end. Fails as RecordingReader::read() does.
  [[nodiscard]] std::expected<std::size_t, InputError> read(std::span<Sample> samples,
                                                            std::span<Truth> truths) {
    assert(samples.size() == truths.size());
    return stream_.read(samples, truths);
  }

 private:
  explicit TruthReader(RecordingStream stream) : stream_(std::move(stream)) {}

  RecordingStream stream_;
};

}  // namespace cutforce::hal::host
