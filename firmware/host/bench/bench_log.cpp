#include "firmware/host/bench/bench_log.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>

#include "firmware/host/bench/board_names.hpp"

namespace cutforce::firmware::host {
namespace {

[[gnu::format(printf, 1, 2)]] std::string formatted(const char* format, ...) {
  char text[160];
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

std::string board_text(const hal::can::Override& said) {
  std::string text(board_state_name(said.state));
  if (said.reason != 0) text += " (" + std::string(reason_name(said.reason)) + ")";
  return text;
}

double count(std::uint32_t number) { return static_cast<double>(number); }

}  // namespace

void BenchLog::event(std::int64_t time_ns, std::string text) {
  if (events_.size() >= kMostEvents) return;
  events_.push_back({static_cast<double>(time_ns) * 1e-9, std::move(text)});
}

void BenchLog::note(const Bench& bench) {
  const Bench::Row& row = bench.row();
  if (row.cnc.state != cnc_) {
    cnc_ = row.cnc.state;
    event(row.time_ns, "CNC: " + std::string(cnc_text(cnc_)));
  }
  note_board(bench);
  note_lines(bench);
  if (row.has_truth) note_force(row);
}

void BenchLog::note_board(const Bench& bench) {
  const auto& heard = bench.heard();
  const std::int64_t time_ns = bench.row().time_ns;
  if (heard.override) {
    const auto state = static_cast<control::SupervisorState>(heard.override->state);
    armed_ = armed_ || state == control::SupervisorState::kMonitor ||
             state == control::SupervisorState::kControl;
    controlled_ = controlled_ || heard.override->enabled;
    const std::uint32_t board = heard.override->state * 256U + heard.override->reason;
    if (board != board_) {
      board_ = board;
      event(time_ns, "board: " + board_text(*heard.override));
    }
  }
  if (heard.counts.emergencies != emergencies_) {
    emergencies_ = heard.counts.emergencies;
    const auto& emergency = *heard.emergency;
    event(time_ns, emergency.error_code == 0
                       ? std::string("emergency: taken back")
                       : formatted("emergency: code %04x, %s", emergency.error_code,
                                   reason_name(emergency.reason).data()));
  }
}

void BenchLog::note_lines(const Bench& bench) {
  const std::int64_t time_ns = bench.row().time_ns;
  const auto& lines = bench.lines();
  if (lines.alarms != alarms_) {
    alarms_ = lines.alarms;
    event(time_ns, "alarm line: on");
  }
  if (lines.invalid != invalid_) {
    invalid_ = lines.invalid;
    event(time_ns, formatted("byte 0x%02X, which the code does not define", lines.byte));
  }
  if (bench.inhibits() != inhibits_) {
    inhibits_ = bench.inhibits();
    event(time_ns, inhibits_ ? "inhibit line: on, control is forbidden" : "inhibit line: off");
  }
}

void BenchLog::note_force(const Bench::Row& row) {
  const double depth_m = row.truth.depth_m;
  if (stretches_.empty() || stretches_.back().depth_m != depth_m) {
    stretches_.push_back({.depth_m = depth_m, .begin_ns = row.time_ns});
  }
  Stretch& stretch = stretches_.back();
  const double force_n = row.truth.cutting_force_n;
  stretch.peak_n = std::max(stretch.peak_n, force_n);
  if (row.time_ns - stretch.begin_ns < kSettling_ns) return;
  ++stretch.count;
  stretch.sum_n += force_n;
  stretch.sum_square_n2 += force_n * force_n;
}

void BenchLog::add_stretches(std::vector<Figure>& out) const {
  for (const Stretch& stretch : stretches_) {
    if (!(stretch.depth_m > 0.0) || stretch.count == 0) continue;
    const auto samples = static_cast<double>(stretch.count);
    const double mean_n = stretch.sum_n / samples;
    const double spread_n =
        std::sqrt(std::max(stretch.sum_square_n2 / samples - mean_n * mean_n, 0.0));
    const std::string at = formatted("at %g mm", 1e3 * stretch.depth_m);
    const std::string key = formatted("at_%g_mm", 1e3 * stretch.depth_m);
    out.push_back(
        {"mean_n_" + key, "True force " + at, mean_n, "N", "mean, 1.5 s after the step on"});
    out.push_back({"stddev_n_" + key, "True force " + at + ", standard deviation", spread_n, "N"});
    out.push_back({"peak_n_" + key, "True force " + at + ", peak", stretch.peak_n, "N"});
  }
}

std::vector<Figure> BenchLog::figures(const Bench& bench) const {
  const auto& heard = bench.heard();
  const auto& counts = heard.counts;
  const auto& row = bench.row();
  std::vector<Figure> out{
      {"time_s", "Sample time", static_cast<double>(row.time_ns) * 1e-9, "s"},
      {"cnc", "CNC", std::string(cnc_name(row.cnc.state)), "",
       std::string(cnc_text(row.cnc.state))},
      {"board", "Board", heard.override ? board_text(*heard.override) : std::string("not heard")},
      {"override_pct", "Override in effect", count(row.cnc.override_pct), "%"},
      {"armings", "Arming edges given", count(bench.cnc().armings)},
      {"silences", "Silences of the board", count(bench.cnc().silences)}};
  if (bench.config().by_lines) {
    const auto& lines = bench.lines();
    out.push_back({"bytes", "Bytes strobed", count(lines.bytes)});
    out.push_back({"invalid_bytes", "Bytes that the code does not define", count(lines.invalid)});
    out.push_back({"alive_edges", "Edges of the alive line", count(lines.alive_edges)});
    out.push_back({"alarms", "Alarms", count(lines.alarms)});
  } else {
    out.push_back({"overrides", "Override frames taken", count(counts.overrides)});
    out.push_back({"longest_gap_ms", "Longest gap between them",
                   static_cast<double>(counts.longest_gap_ns) * 1e-6, "ms"});
    out.push_back(
        {"missing", "Override frames missing", count(counts.missing), "", "by the counter"});
    out.push_back({"wrong_crc", "Frames with a wrong CRC", count(counts.wrong_crc)});
    out.push_back({"repeated", "Frames with a repeated counter", count(counts.repeated)});
    out.push_back({"jumped", "Frames whose counter jumped", count(counts.jumped)});
    out.push_back({"malformed", "Frames of the wrong form", count(counts.malformed)});
    out.push_back({"foreign", "Frames with our identifiers", count(counts.foreign), "",
                   "another CNC or acquisition node on the bus"});
    out.push_back({"heartbeats", "Heartbeats", count(counts.heartbeats)});
    out.push_back({"emergencies", "Emergencies", count(counts.emergencies)});
  }
  if (heard.diagnostics) {
    out.push_back({"board_refused", "Frames that the board refused",
                   count(heard.diagnostics->refused_frames), "", "low 8 bits"});
    out.push_back({"board_lost", "Samples that the board missed",
                   count(heard.diagnostics->lost_samples), "", "low 8 bits"});
    out.push_back({"board_worst_us", "The board's longest loop",
                   count(heard.diagnostics->worst_loop_us), "us"});
  }
  add_stretches(out);
  return out;
}

bool BenchLog::held(const Bench& bench) const noexcept {
  if (bench.config().by_lines) return bench.heard_by_lines();
  if (!bench.heard().override) return false;
  return (!bench.config().cnc.arm || armed_) && (!bench.config().cnc.control || controlled_);
}

std::string BenchLog::verdict(const Bench& bench) const {
  const bool lines = bench.config().by_lines;
  if (lines ? !bench.heard_by_lines() : !bench.heard().override) {
    return "The board was not heard.";
  }
  if (bench.config().cnc.arm && !armed_ && !lines) return "The board was heard, but not armed.";
  if (bench.config().cnc.control && !controlled_ && !lines) {
    return "The board was armed, but did not take control.";
  }
  if (is_silent(bench.row().cnc.state)) {
    return "The board fell silent; the CNC fell back: " +
           std::string(cnc_text(bench.row().cnc.state)) + ".";
  }
  return "The board was heard to the end.";
}

std::string live_text(const Bench& bench) {
  const auto& heard = bench.heard();
  const auto& row = bench.row();
  if (row.waiting) return "waiting for the board";
  std::string text = heard.override ? board_text(*heard.override) : std::string("board not heard");
  if (!heard.override && bench.heard_by_lines()) {
    text = formatted("byte 0x%02X", bench.lines().byte);
  }
  text += formatted(", override %u %%", row.cnc.override_pct);
  if (heard.override && heard.override->force_n) {
    text += formatted(", force %.0f N", static_cast<double>(*heard.override->force_n));
  }
  if (row.has_truth) text += formatted(" (true %.0f)", row.truth.cutting_force_n);
  const auto& c = heard.counts;
  const std::uint32_t refused = c.wrong_crc + c.repeated + c.jumped + c.malformed;
  if (refused != 0) text += formatted(", %u refused", refused);
  if (c.missing != 0) text += formatted(", %u missing", c.missing);
  if (row.cnc.state != CncState::kFollowing)
    text += "; CNC: " + std::string(cnc_text(row.cnc.state));
  return text;
}

}  // namespace cutforce::firmware::host
