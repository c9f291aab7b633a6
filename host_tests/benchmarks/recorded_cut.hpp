// What the benchmarks run on: the default lathe in closed loop with itself, simulated.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "firmware/machine.hpp"
#include "hal/port.hpp"

namespace cutforce::benchmarks {

// The default machine, complete, at this sample rate.
[[nodiscard]] firmware::Machine lathe_at(double sample_rate_hz, firmware::EstimatorName estimator);

// Rows from time 0: run-up, air, first and second depth of cut, air.
[[nodiscard]] std::vector<hal::Sample> recorded_cut(double sample_rate_hz, double duration_s);

// A stretch of the cut, over and over with the time going on. It ends where it begins, as nearly as
// the signals allow, so that a loop sees no step where it starts again.
class EndlessCut {
 public:
  explicit EndlessCut(double sample_rate_hz);

  // Run-up, air and entry, for a block to go through before it is measured.
  [[nodiscard]] std::span<const hal::Sample> beginning() const;

  const hal::Sample& next() noexcept {
    sample_ = rows_[at_];
    sample_.time_ns += lap_ns_;
    if (++at_ == end_) {
      at_ = begin_;
      lap_ns_ += period_ns_ * static_cast<std::int64_t>(end_ - begin_);
    }
    return sample_;
  }

 private:
  std::vector<hal::Sample> rows_;
  hal::Sample sample_{};
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::size_t at_ = 0;
  std::int64_t lap_ns_ = 0;
  std::int64_t period_ns_ = 0;
};

// Recordings r.csv, r.csv.gz and r.cfr of one run at 20 kHz; nine columns, rounded as an instrument
// writes them. Made once a process, in the folder CUTFORCE_BENCHMARK_FOLDER and left there, or in
// one of their own that goes with the process.
class RecordingFiles {
 public:
  static constexpr std::size_t kRows = 400'000;

  [[nodiscard]] static const RecordingFiles& get();
  [[nodiscard]] std::filesystem::path operator/(const char* name) const { return folder_ / name; }

  RecordingFiles(const RecordingFiles&) = delete;
  RecordingFiles& operator=(const RecordingFiles&) = delete;

 private:
  RecordingFiles();
  ~RecordingFiles();

  std::filesystem::path folder_;
  bool own_;
};

}  // namespace cutforce::benchmarks
