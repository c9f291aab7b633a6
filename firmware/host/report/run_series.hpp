// The series of a run on one time grid, ready to embed. See report.hpp for the rules.
#pragma once

#include <cstddef>
#include <expected>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

struct TraceFile {
  std::string name;
  std::filesystem::path path;
};

struct RunSeries {
  std::string key;            // "0.cutting_force_n": of the first trace; "r.…": of the recording
  std::vector<float> values;  // NaN: none
};

// Stretches of time in which a word column does not change.
struct WordRun {
  double from_s;
  double to_s;
  std::string word;
};
struct WordStrip {
  std::string key;
  std::vector<WordRun> runs;
};

struct Run {
  std::vector<double> time_s;
  std::vector<RunSeries> series;
  std::vector<WordStrip> strips;
  std::optional<double> entry_s;  // the load first passes a tenth of its extreme
  std::optional<double> exit_s;   // it last falls below that; both from the truth, else the state
  std::size_t rows_per_stretch = 0;  // 0: every row is there
};

inline constexpr std::size_t kMostRows = 300'000;

// An empty `recording` means that there is none. Fails iff read_columns does.
[[nodiscard]] std::expected<Run, hal::host::InputError> read_run(
    const std::vector<TraceFile>& traces, const std::filesystem::path& recording,
    std::size_t most_rows = kMostRows);

}  // namespace cutforce::firmware::host
