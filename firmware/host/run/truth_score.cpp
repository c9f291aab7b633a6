#include "firmware/host/run/truth_score.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace cutforce::firmware::host {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kSettled_ratio = 0.05;
constexpr double kLeastStretch_s = 0.5;
constexpr double kJump_m = 1e-5;

std::string millimetres(double depth_m) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g mm", 1e3 * depth_m);
  return text;
}

}  // namespace

void TruthScore::add(const LoopOutput& output, const hal::host::MachineTruth& truth) {
  const bool known = (output.present & LoopOutput::kCuttingTorque) != 0;
  rows_.push_back({.time_s = static_cast<double>(output.time_ns) * 1e-9,
                   .depth_m = truth.depth_m,
                   .true_force_n = truth.cutting_force_n,
                   .true_torque_nm = truth.cutting_torque_nm,
                   .torque_nm = known ? static_cast<double>(output.cutting_torque_nm) : kNan,
                   .sigma_nm = known ? static_cast<double>(output.cutting_torque_sigma_nm) : kNan,
                   .override_pct = static_cast<double>(output.override_pct)});
}

std::vector<TruthScore::Stretch> TruthScore::stretches() const {
  std::vector<Stretch> found;
  std::size_t begin = 0;
  for (std::size_t k = 1; k <= rows_.size(); ++k) {
    const bool ends =
        k == rows_.size() || std::abs(rows_[k].depth_m - rows_[begin].depth_m) > kJump_m;
    if (!ends) continue;
    const double length_s = rows_[k - 1].time_s - rows_[begin].time_s;
    if (rows_[begin].depth_m > 0.0 && length_s >= kLeastStretch_s) {
      found.push_back({.begin = begin, .end = k, .depth_m = rows_[begin].depth_m});
    }
    begin = k;
  }
  return found;
}

std::vector<Event> TruthScore::events() const {
  constexpr std::size_t kMost = 100;  // a depth along a slope jumps all the time
  std::vector<Event> events;
  for (std::size_t k = 1; k < rows_.size() && events.size() < kMost; ++k) {
    const double before_m = rows_[k - 1].depth_m;
    const double after_m = rows_[k].depth_m;
    if (std::abs(after_m - before_m) <= kJump_m) continue;
    const std::string text = before_m == 0.0 ? "tool enters, " + millimetres(after_m) + " deep"
                             : after_m == 0.0
                                 ? std::string("tool leaves")
                                 : "depth " + millimetres(before_m) + " to " + millimetres(after_m);
    events.push_back({.time_s = rows_[k].time_s, .text = text});
  }
  return events;
}

// -sum(error * slope) / sum(slope^2): the delay of the truth that fits best.
double TruthScore::lag_s() const {
  double product = 0.0;
  double square = 0.0;
  for (std::size_t k = 1; k + 1 < rows_.size(); ++k) {
    if (std::isnan(rows_[k].torque_nm)) continue;
    const double slope = (rows_[k + 1].true_torque_nm - rows_[k - 1].true_torque_nm) /
                         (rows_[k + 1].time_s - rows_[k - 1].time_s);
    product -= (rows_[k].torque_nm - rows_[k].true_torque_nm) * slope;
    square += slope * slope;
  }
  return square > 0.0 ? product / square : kNan;
}

std::vector<Figure> TruthScore::estimate_figures(const Machine& machine) const {
  const auto rated_nm = static_cast<double>(machine.rated_torque_nm);
  double sum = 0.0;
  double square = 0.0;
  double worst = 0.0;
  std::size_t known = 0;
  std::size_t covered = 0;
  for (const Row& row : rows_) {
    if (std::isnan(row.torque_nm)) continue;
    const double error = row.torque_nm - row.true_torque_nm;
    sum += error;
    square += error * error;
    worst = std::max(worst, std::abs(error));
    ++known;
    if (std::abs(error) <= 2.0 * row.sigma_nm) ++covered;
  }
  if (known == 0) return {};
  const auto count = static_cast<double>(known);
  std::vector<Figure> figures{
      {"error_mean_pct", "Torque error, mean", 100.0 * sum / count / rated_nm, "% of rated"},
      {"error_rms_pct", "Torque error, rms", 100.0 * std::sqrt(square / count) / rated_nm,
       "% of rated"},
      {"error_worst_pct", "Torque error, worst", 100.0 * worst / rated_nm, "% of rated"},
      {"coverage_pct", "Torque error within 2 sigma", 100.0 * static_cast<double>(covered) / count,
       "%", "of the time; 95 or more is right"}};
  const double lag = lag_s();
  if (std::isfinite(lag)) {
    figures.push_back({"estimate_lag_ms", "Torque estimate's lag", 1e3 * lag, "ms"});
  }
  return figures;
}

void TruthScore::add_stretch(const Stretch& stretch, double reference_n,
                             std::vector<Figure>& out) const {
  const auto at = [this](std::size_t k) -> const Row& { return rows_[k]; };
  const double begin_s = at(stretch.begin).time_s;
  double settled_s = 0.0;  // the last time outside the band ends it
  double peak_n = 0.0;
  for (std::size_t k = stretch.begin; k < stretch.end; ++k) {
    peak_n = std::max(peak_n, at(k).true_force_n);
    const double error = std::abs(at(k).true_force_n - reference_n);
    if (error > kSettled_ratio * reference_n) settled_s = at(k).time_s - begin_s;
  }
  const double length_s = at(stretch.end - 1).time_s - begin_s;
  double sum = 0.0;
  double square = 0.0;
  double count = 0.0;
  for (std::size_t k = stretch.begin + (stretch.end - stretch.begin) / 2; k < stretch.end; ++k) {
    sum += at(k).true_force_n;
    square += at(k).true_force_n * at(k).true_force_n;
    count += 1.0;
  }
  const double mean_n = sum / count;
  const std::string depth = millimetres(stretch.depth_m);
  const std::string held = "Force at " + depth;
  const std::string key = "depth_" + depth.substr(0, depth.find(' ')) + "_mm_";
  out.push_back({key + "force_n", held, mean_n, "N", "true force, second half of the stretch"});
  out.push_back({key + "steady_error_pct", held + ", steady error",
                 100.0 * (mean_n - reference_n) / reference_n, "% of reference"});
  out.push_back({key + "force_sd_n", held + ", standard deviation",
                 std::sqrt(std::max(square / count - mean_n * mean_n, 0.0)), "N"});
  out.push_back({key + "peak_n", held + ", peak", peak_n, "N"});
  if (settled_s < 0.95 * length_s) {
    out.push_back({key + "settling_s", held + ", within 5 % after", settled_s, "s"});
  } else {
    out.push_back({key + "settling_s", held + ", within 5 % after", std::string("never"), ""});
  }
}

std::vector<Figure> TruthScore::force_figures(const Machine& machine) const {
  std::vector<Figure> figures;
  if (machine.controller == ControllerName::kNone) return figures;
  constexpr std::size_t kMost = 6;
  const auto reference_n = static_cast<double>(machine.force_reference_n);
  figures.push_back({"force_reference_n", "Force to hold", reference_n, "N"});
  const auto all = stretches();
  for (std::size_t k = 0; k < std::min(all.size(), kMost); ++k) {
    add_stretch(all[k], reference_n, figures);
  }
  return figures;
}

}  // namespace cutforce::firmware::host
