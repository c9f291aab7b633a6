#include "firmware/host/bench/bench_trace.hpp"

#include <utility>

#include "firmware/host/bench/board_names.hpp"

namespace cutforce::firmware::host {
namespace {

constexpr std::size_t kMaxRowBytes = 512;

}  // namespace

std::expected<BenchTrace, hal::host::InputError> BenchTrace::create(
    const std::filesystem::path& path) {
  auto file = hal::host::OutputFile::create(path);
  if (!file) return std::unexpected{file.error()};
  hal::host::TextRows rows(std::move(*file), kMaxRowBytes);
  for (const char* line :
       {"# cutforce bench 1",
        "t_s,cnc,override_pct,override_applied_pct,board_state,reason,board_override_pct,enabled,"
        "force_n,true_cutting_force_n,true_feed_m_s,depth_m"}) {
    if (auto written = rows.line(line); !written) return std::unexpected{written.error()};
  }
  return BenchTrace(std::move(rows));
}

std::expected<void, hal::host::InputError> BenchTrace::take(const Bench& bench) {
  const Bench::Row& row = bench.row();
  if (row.waiting || row.time_ns % bench.config().cnc.scan_ns != 0) return {};
  const auto optional_number = [this](const auto& value) {
    if (value) {
      rows_.number(static_cast<float>(*value));
    } else {
      rows_.empty();
    }
  };
  rows_.time(row.time_ns);
  rows_.text(cnc_name(row.cnc.state));
  rows_.number(static_cast<float>(row.cnc.override_pct));
  const auto& truth = row.truth;
  optional_number(row.has_truth ? std::optional{truth.override_pct} : std::nullopt);
  if (const auto& said = bench.heard().override) {
    rows_.text(board_state_name(said->state));
    rows_.text(reason_name(said->reason));
    optional_number(said->override_pct);
    rows_.text(said->enabled ? "1" : "0");
    optional_number(said->force_n);
  } else {
    rows_.empty();
    rows_.empty();
    optional_number(bench.lines().override_pct);
    rows_.empty();
    rows_.empty();
  }
  for (const double value : {truth.cutting_force_n, truth.feed_m_s, truth.depth_m}) {
    optional_number(row.has_truth ? std::optional{value} : std::nullopt);
  }
  return rows_.end_row();
}

}  // namespace cutforce::firmware::host
