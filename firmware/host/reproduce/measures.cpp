// What closed_loop.hpp asks of a run.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "firmware/host/reproduce/closed_loop.hpp"

namespace cutforce::firmware::host {
namespace {

constexpr double kLeastStretch_s = 0.5;
constexpr double kJump_m = 1e-6;

// f(value) for each value within the span.
template <class F>
void each(const std::vector<double>& time_s, const std::vector<double>& values, const Span& span,
          F&& f) {
  auto at = std::ranges::lower_bound(time_s, span.from_s);
  for (; at != time_s.end() && *at <= span.to_s; ++at) {
    f(values[static_cast<std::size_t>(at - time_s.begin())]);
  }
}

}  // namespace

std::vector<Stretch> stretches(const ClosedLoop& run) {
  std::vector<Stretch> found;
  std::size_t begin = 0;
  for (std::size_t k = 1; k <= run.time_s.size(); ++k) {
    const bool ends =
        k == run.time_s.size() || std::abs(run.depth_m[k] - run.depth_m[begin]) > kJump_m;
    if (!ends) continue;
    const Span span{run.time_s[begin], run.time_s[k - 1]};
    if (run.depth_m[begin] > 0.0 && span.to_s - span.from_s >= kLeastStretch_s) {
      found.push_back({.span = span, .depth_m = run.depth_m[begin]});
    }
    begin = k;
  }
  return found;
}

Span last_part(const Span& span, double ratio) {
  return {span.to_s - ratio * (span.to_s - span.from_s), span.to_s};
}

double mean_n(const ClosedLoop& run, const Span& span) {
  double sum = 0.0;
  double count = 0.0;
  each(run.time_s, run.force_n, span, [&](double force_n) {
    sum += force_n;
    count += 1.0;
  });
  return sum / count;
}

double deviation_n(const ClosedLoop& run, const Span& span) {
  const double mean = mean_n(run, span);
  double square = 0.0;
  double count = 0.0;
  each(run.time_s, run.force_n, span, [&](double force_n) {
    square += (force_n - mean) * (force_n - mean);
    count += 1.0;
  });
  return std::sqrt(square / count);
}

double most_n(const ClosedLoop& run, const Span& span) {
  double most = 0.0;
  each(run.time_s, run.force_n, span, [&](double force_n) { most = std::max(most, force_n); });
  return most;
}

double least_n(const ClosedLoop& run, const Span& span) {
  double least = std::numeric_limits<double>::infinity();
  each(run.time_s, run.force_n, span, [&](double force_n) { least = std::min(least, force_n); });
  return least;
}

double settling_s(const ClosedLoop& run, const Span& span, double band_ratio) {
  double outside_s = span.from_s;
  for (std::size_t k = 0; k < run.time_s.size(); ++k) {
    if (run.time_s[k] < span.from_s || run.time_s[k] > span.to_s) continue;
    const double error_n = std::abs(run.force_n[k] - run.reference_n);
    if (error_n > band_ratio * run.reference_n) outside_s = run.time_s[k];
  }
  const bool never = outside_s > span.to_s - 0.02 * (span.to_s - span.from_s);
  return never ? std::numeric_limits<double>::infinity() : outside_s - span.from_s;
}

double mean_override_pct(const ClosedLoop& run, const Span& span) {
  double sum = 0.0;
  double count = 0.0;
  each(run.tick_s, run.override_pct, span, [&](double override_pct) {
    sum += override_pct;
    count += 1.0;
  });
  return sum / count;
}

double changes_1_s(const ClosedLoop& run, const Span& span) {
  double before = std::numeric_limits<double>::quiet_NaN();
  double changes = 0.0;
  each(run.tick_s, run.override_pct, span, [&](double override_pct) {
    if (!std::isnan(before) && override_pct != before) changes += 1.0;
    before = override_pct;
  });
  return changes / (span.to_s - span.from_s);
}

int swings(const ClosedLoop& run, const Span& span, double swing_pct) {
  double turn_pct = std::numeric_limits<double>::quiet_NaN();  // where the last swing ended
  double extreme_pct = 0.0;                                    // so far, in its direction
  int direction = 0;
  int count = 0;
  each(run.tick_s, run.override_pct, span, [&](double override_pct) {
    if (std::isnan(turn_pct)) turn_pct = extreme_pct = override_pct;
    const double moved = override_pct - extreme_pct;
    if (direction == 0 || direction * moved > 0.0) {
      if (direction == 0 && moved != 0.0) direction = moved > 0.0 ? 1 : -1;
      extreme_pct = override_pct;
    } else if (std::abs(moved) >= swing_pct) {
      if (std::abs(extreme_pct - turn_pct) >= swing_pct) ++count;
      turn_pct = extreme_pct;
      extreme_pct = override_pct;
      direction = -direction;
    }
  });
  if (std::abs(extreme_pct - turn_pct) >= swing_pct) ++count;
  return count;
}

double lowest_override_pct(const ClosedLoop& run, const Span& span) {
  double least = std::numeric_limits<double>::infinity();
  each(run.tick_s, run.override_pct, span, [&](double value) { least = std::min(least, value); });
  return least;
}

double highest_override_pct(const ClosedLoop& run, const Span& span) {
  double most = 0.0;
  each(run.tick_s, run.override_pct, span, [&](double value) { most = std::max(most, value); });
  return most;
}

}  // namespace cutforce::firmware::host
