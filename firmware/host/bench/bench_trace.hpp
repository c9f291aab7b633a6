// What the bench saw, as a table: a row each scan of the CNC. The columns of sample time and of the
// CNC (t_s, cnc, override_pct, true_...) depend on the board's answers alone; those of what was
// heard last depend on when it was heard, too. What does not exist is an empty cell.
//
//   t_s, cnc, override_pct, override_applied_pct, board_state, reason, board_override_pct, enabled,
//   force_n, true_cutting_force_n, true_feed_m_s, depth_m
#pragma once

#include <expected>
#include <filesystem>

#include "firmware/host/bench/bench.hpp"
#include "hal/host/input_error.hpp"
#include "hal/host/text_rows.hpp"

namespace cutforce::firmware::host {

class BenchTrace {
 public:
  // Each fails iff the system refuses the file.
  [[nodiscard]] static std::expected<BenchTrace, hal::host::InputError> create(
      const std::filesystem::path& path);
  // After each step; writes where a scan is due.
  [[nodiscard]] std::expected<void, hal::host::InputError> take(const Bench& bench);
  [[nodiscard]] std::expected<void, hal::host::InputError> finish() { return rows_.finish(); }

 private:
  explicit BenchTrace(hal::host::TextRows rows) : rows_(std::move(rows)) {}

  hal::host::TextRows rows_;
};

}  // namespace cutforce::firmware::host
