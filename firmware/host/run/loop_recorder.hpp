// One loop and where its outputs go: statistics of all of them, and every n-th as a row of a trace.
#pragma once

#include <cstdint>
#include <expected>
#include <filesystem>
#include <optional>
#include <string>

#include "firmware/configuration.hpp"
#include "firmware/control_loop.hpp"
#include "firmware/host/run/run_statistics.hpp"
#include "firmware/host/trace_writer.hpp"
#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

// What configuration.hpp refuses, in words. A machine that passed its check is seldom refused.
[[nodiscard]] hal::host::InputError loop_refused(const ConfigurationFailure& failure,
                                                 const std::string& where);
[[nodiscard]] std::expected<ControlLoop, hal::host::InputError> loop_for(const Machine& machine,
                                                                         const std::string& where);

// Which outputs become rows.
struct TraceRows {
  bool control_ticks = true;    // those that end a control period
  std::uint32_t every_nth = 1;  // else
};

class LoopRecorder {
 public:
  // Fails iff the file cannot be made.
  [[nodiscard]] static std::expected<LoopRecorder, hal::host::InputError> create(
      const std::filesystem::path& trace, TraceRows rows);

  void take(const LoopOutput& output) {
    statistics_.add(output);
    faults_ = faults_ | output.faults;
    const bool row = rows_.control_ticks ? output.control_tick : ++since_row_ >= rows_.every_nth;
    if (!row || failed_) return;
    since_row_ = 0;
    ++written_;
    LoopOutput shown = output;
    shown.faults = faults_;  // of all outputs since the last row: none is silent
    faults_ = {};
    if (auto written = trace_.write(shown); !written) failed_ = written.error();
  }

  // Fails iff the file did, now or at any row.
  [[nodiscard]] std::expected<void, hal::host::InputError> finish();
  [[nodiscard]] const RunStatistics& statistics() const noexcept { return statistics_; }
  [[nodiscard]] std::uint64_t rows() const noexcept { return written_; }
  [[nodiscard]] bool failed() const noexcept { return failed_.has_value(); }

 private:
  LoopRecorder(TraceWriter trace, TraceRows rows) : trace_(std::move(trace)), rows_(rows) {}

  TraceWriter trace_;
  TraceRows rows_;
  RunStatistics statistics_;
  estimator::FaultSet faults_{};
  std::uint32_t since_row_ = 0;
  std::uint64_t written_ = 0;
  std::optional<hal::host::InputError> failed_;
};

}  // namespace cutforce::firmware::host
