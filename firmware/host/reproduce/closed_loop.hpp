// A scenario run in memory, without a file: what was true at each step of the simulation, and what
// the loop saw and sent at each tick. And what is asked of such a run.
#pragma once

#include <expected>
#include <vector>

#include "firmware/host/scenario/scenario.hpp"

namespace cutforce::firmware::host {

struct ClosedLoop {
  double reference_n = 0.0;
  double ceiling_pct = 0.0;
  double period_s = 0.0;    // of control
  double finished_s = 0.0;  // the path was at its end; the end of the run if it never was

  // At each step.
  std::vector<double> time_s;
  std::vector<double> force_n;  // true
  std::vector<double> depth_m;
  // At each tick.
  std::vector<double> tick_s;
  std::vector<double> seen_n;  // the force that the loop acted on; NaN: none
  std::vector<double> override_pct;
};

// Fails iff the scenario's machines are refused. Throws Stopped.
[[nodiscard]] std::expected<ClosedLoop, InputError> run_closed_loop(const Scenario& scenario);

struct Span {
  double from_s;
  double to_s;
};

// Stretches of one depth of cut above 0 that last 0.5 s at least, in order.
struct Stretch {
  Span span;
  double depth_m;
};
[[nodiscard]] std::vector<Stretch> stretches(const ClosedLoop& run);
// The last part of a stretch; ratio 0.5 is its second half.
[[nodiscard]] Span last_part(const Span& span, double ratio);

// Of the true force.
[[nodiscard]] double mean_n(const ClosedLoop& run, const Span& span);
[[nodiscard]] double deviation_n(const ClosedLoop& run, const Span& span);  // standard deviation
[[nodiscard]] double most_n(const ClosedLoop& run, const Span& span);
[[nodiscard]] double least_n(const ClosedLoop& run, const Span& span);
// From the begin of the span until the force is within the band for good; infinity: never.
[[nodiscard]] double settling_s(const ClosedLoop& run, const Span& span, double band_ratio);

// Of the override that was sent.
[[nodiscard]] double mean_override_pct(const ClosedLoop& run, const Span& span);
[[nodiscard]] double changes_1_s(const ClosedLoop& run, const Span& span);
// Swings of at least `swing_pct` from one turn to the next.
[[nodiscard]] int swings(const ClosedLoop& run, const Span& span, double swing_pct);
[[nodiscard]] double lowest_override_pct(const ClosedLoop& run, const Span& span);
[[nodiscard]] double highest_override_pct(const ClosedLoop& run, const Span& span);

}  // namespace cutforce::firmware::host
