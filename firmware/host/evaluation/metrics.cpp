#include "firmware/host/evaluation/metrics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>

namespace cutforce::firmware::host {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kBeforeStep_s = 0.02;  // an estimate may lead, if the inertia is wrong
constexpr double kGapPeriods = 3.0;
constexpr double kRampTrim_ratio = 0.1;
constexpr double kToneShare_ratio = 0.8;

void keep_worst(std::optional<double>& worst, double value) {
  if (!worst || value > *worst) worst = value;
}

class Scorer {
 public:
  Scorer(const TruthSeries& truth, const LoadProfile& profile, const EstimateSeries& estimate)
      : truth_(truth), profile_(profile), e_(estimate), pct_(100.0 / truth.rated_torque_nm) {
    true_nm_.reserve(e_.time_s.size());
    for (const double t : e_.time_s)
      true_nm_.push_back(interpolate(truth.time_s, truth.torque_nm, t));
  }

  Metrics run() {
    for (const auto& plateau : profile_.plateaus) score_plateau(plateau);
    for (const auto& step : profile_.steps) score_step(step);
    for (const auto& ramp : profile_.ramps) score_ramp(ramp);
    for (const auto& tone : profile_.tones) score_tone(tone);
    score_time();
    return std::move(metrics_);
  }

 private:
  [[nodiscard]] std::size_t index(double at_s) const {
    return static_cast<std::size_t>(std::lower_bound(e_.time_s.begin(), e_.time_s.end(), at_s) -
                                    e_.time_s.begin());
  }
  [[nodiscard]] bool valid(std::size_t k) const { return std::isfinite(e_.torque_nm[k]); }
  [[nodiscard]] double error_nm(std::size_t k) const { return e_.torque_nm[k] - true_nm_[k]; }

  void score_plateau(const Plateau& plateau) {
    if (plateau.to_s <= profile_.scored_from_s) return;
    const double from_s = 0.5 * (plateau.from_s + plateau.to_s);
    double sum = 0.0;
    double square = 0.0;
    double count = 0.0;
    const std::size_t last = index(plateau.to_s);
    for (std::size_t k = index(from_s); k < last; ++k) {
      if (!valid(k)) continue;
      sum += error_nm(k);
      count += 1.0;
    }
    if (count < 2.0) return;
    const double mean = sum / count;
    for (std::size_t k = index(from_s); k < last; ++k)
      if (valid(k)) square += (error_nm(k) - mean) * (error_nm(k) - mean);
    const double noise = std::sqrt(square / (count - 1.0));
    const double level = interpolate(truth_.time_s, truth_.torque_nm, from_s);
    metrics_.plateaus.push_back({.from_s = from_s,
                                 .to_s = plateau.to_s,
                                 .level_pct = level * pct_,
                                 .error_pct = mean * pct_,
                                 .noise_pct = noise * pct_});
    keep_worst(metrics_.steady_error_pct, std::abs(mean) * pct_);
    keep_worst(metrics_.noise_pct, noise * pct_);
  }

  // First crossing of a level at or after `from_s`, NaN if there is none before `to_s`.
  [[nodiscard]] static double crossing_s(const std::vector<double>& t, const std::vector<double>& x,
                                         double from_s, double to_s, double level, bool up) {
    const auto begin = std::lower_bound(t.begin(), t.end(), from_s);
    for (auto k = static_cast<std::size_t>(begin - t.begin()); k < t.size() && t[k] <= to_s; ++k) {
      const bool beyond = up ? x[k] >= level : x[k] <= level;
      if (!beyond) continue;  // also where there is no estimate
      const bool interpolable =
          k > 0 && std::isfinite(x[k - 1]) && t[k - 1] >= from_s && x[k] != x[k - 1];
      if (!interpolable) return t[k];
      const double part = (level - x[k - 1]) / (x[k] - x[k - 1]);
      return t[k - 1] + std::clamp(part, 0.0, 1.0) * (t[k] - t[k - 1]);
    }
    return kNan;
  }

  [[nodiscard]] double lag_ms(const LoadChange& step, double share) const {
    const double level = step.before_nm + share * (step.after_nm - step.before_nm);
    const bool up = step.after_nm > step.before_nm;
    const double true_s =
        crossing_s(truth_.time_s, truth_.torque_nm, step.from_s, step.to_s, level, up);
    const double seen_s =
        crossing_s(e_.time_s, e_.torque_nm, step.from_s - kBeforeStep_s, step.until_s, level, up);
    return std::isnan(seen_s) ? kInfinity : 1e3 * (seen_s - true_s);
  }

  // A step is over where the settled part of the plateau after it begins, or at the next change.
  [[nodiscard]] double transient_end_s(const LoadChange& step) const {
    for (const auto& plateau : profile_.plateaus)
      if (plateau.from_s >= step.from_s)
        return std::min(step.until_s, 0.5 * (plateau.from_s + plateau.to_s));
    return step.until_s;
  }

  void score_step(const LoadChange& step) {
    const std::size_t first = index(step.from_s);
    const std::size_t last = index(transient_end_s(step));
    const bool any = std::any_of(e_.torque_nm.begin() + static_cast<std::ptrdiff_t>(first),
                                 e_.torque_nm.begin() + static_cast<std::ptrdiff_t>(last),
                                 [](double x) { return std::isfinite(x); });
    if (!any) return;
    const double sign = step.after_nm > step.before_nm ? 1.0 : -1.0;
    double seen = -kInfinity;
    double extreme = sign * step.after_nm;
    for (std::size_t k = first; k < last; ++k) {
      extreme = std::max(extreme, sign * true_nm_[k]);
      if (valid(k)) seen = std::max(seen, sign * e_.torque_nm[k]);
    }
    const double size = std::abs(step.after_nm - step.before_nm);
    const StepScore result{.from_s = step.from_s,
                           .change_pct = (step.after_nm - step.before_nm) * pct_,
                           .t50_ms = lag_ms(step, 0.5),
                           .t90_ms = lag_ms(step, 0.9),
                           .overshoot_pct = 100.0 * std::max(0.0, seen - extreme) / size};
    metrics_.steps.push_back(result);
    keep_worst(metrics_.t50_ms, result.t50_ms);
    keep_worst(metrics_.t90_ms, result.t90_ms);
    keep_worst(metrics_.overshoot_pct, result.overshoot_pct);
    const double least = metrics_.least_t50_ms.value_or(result.t50_ms);
    metrics_.least_t50_ms = std::min(least, result.t50_ms);
  }

  void score_ramp(const LoadChange& ramp) {
    const double trim_s = kRampTrim_ratio * (ramp.to_s - ramp.from_s);
    double with_slope = 0.0;
    double slope_square = 0.0;
    double sum = 0.0;
    double count = 0.0;
    const std::size_t last = index(ramp.to_s - trim_s);
    for (std::size_t k = std::max<std::size_t>(1, index(ramp.from_s + trim_s)); k < last; ++k) {
      if (!valid(k)) continue;
      const double slope = (true_nm_[k] - true_nm_[k - 1]) / (e_.time_s[k] - e_.time_s[k - 1]);
      with_slope += error_nm(k) * slope;
      slope_square += slope * slope;
      sum += error_nm(k);
      count += 1.0;
    }
    if (count < 2.0 || !(slope_square > 0.0)) return;
    const RampScore result{
        .from_s = ramp.from_s,
        .slope_pct_s = (ramp.after_nm - ramp.before_nm) / (ramp.to_s - ramp.from_s) * pct_,
        .lag_ms = -1e3 * with_slope / slope_square,
        .error_pct = sum / count * pct_};
    metrics_.ramps.push_back(result);
    keep_worst(metrics_.ramp_lag_ms, result.lag_ms);
    keep_worst(metrics_.ramp_error_pct, std::abs(result.error_pct));
  }

  void score_tone(const Tone& tone) {
    std::vector<double> time_s;
    std::vector<double> seen_nm;
    std::vector<double> true_nm;
    const std::size_t first = index(tone.from_s);
    const std::size_t last = index(tone.to_s);
    for (std::size_t k = first; k < last; ++k) {
      if (!valid(k)) continue;
      time_s.push_back(e_.time_s[k]);
      seen_nm.push_back(e_.torque_nm[k]);
      true_nm.push_back(true_nm_[k]);
    }
    if (static_cast<double>(time_s.size()) < kToneShare_ratio * static_cast<double>(last - first))
      return;
    const ToneFit seen = fit_tone(time_s, seen_nm, tone.frequency_hz);
    const ToneFit real = fit_tone(time_s, true_nm, tone.frequency_hz);
    const double amplitude = std::hypot(real.cosine, real.sine);
    if (!(amplitude > 0.0)) return;
    const double phase = std::atan2(seen.sine * real.cosine - seen.cosine * real.sine,
                                    seen.cosine * real.cosine + seen.sine * real.sine);
    metrics_.tones.push_back({.frequency_hz = tone.frequency_hz,
                              .amplitude_pct = tone.amplitude_nm * pct_,
                              .gain_ratio = std::hypot(seen.cosine, seen.sine) / amplitude,
                              .lag_ms = 1e3 * phase / (2.0 * std::numbers::pi * tone.frequency_hz),
                              .phase_deg = phase * 180.0 / std::numbers::pi});
  }

  [[nodiscard]] double usual_period_s() const {
    std::vector<double> periods;
    for (std::size_t k = 1; k < e_.time_s.size(); ++k)
      periods.push_back(e_.time_s[k] - e_.time_s[k - 1]);
    if (periods.empty()) return 0.0;
    const auto middle = periods.begin() + static_cast<std::ptrdiff_t>(periods.size() / 2);
    std::nth_element(periods.begin(), middle, periods.end());
    return *middle;
  }

  void score_time() {
    const double longest_s = kGapPeriods * usual_period_s();
    double available_s = 0.0;
    double covered_s = 0.0;
    double with_sigma_s = 0.0;
    double sigma_nm_s = 0.0;
    for (std::size_t k = 0; k < e_.time_s.size(); ++k) {
      if (!valid(k)) continue;
      if (!metrics_.first_estimate_s) metrics_.first_estimate_s = e_.time_s[k];
      if (k == 0 || e_.time_s[k] <= profile_.scored_from_s || e_.time_s[k] > profile_.scored_to_s)
        continue;
      const double since_s = std::max(e_.time_s[k - 1], profile_.scored_from_s);
      const double dt = std::min(e_.time_s[k] - since_s, longest_s);
      available_s += dt;
      if (!std::isfinite(e_.sigma_nm[k])) continue;
      with_sigma_s += dt;
      sigma_nm_s += e_.sigma_nm[k] * dt;
      if (std::abs(error_nm(k)) <= 2.0 * e_.sigma_nm[k]) covered_s += dt;
    }
    const double scored_s = profile_.scored_to_s - profile_.scored_from_s;
    if (scored_s > 0.0) metrics_.availability_pct = 100.0 * std::min(1.0, available_s / scored_s);
    if (!(with_sigma_s > 0.0)) return;
    metrics_.coverage_pct = 100.0 * covered_s / with_sigma_s;
    metrics_.mean_sigma_pct = sigma_nm_s / with_sigma_s * pct_;
  }

  const TruthSeries& truth_;
  const LoadProfile& profile_;
  const EstimateSeries& e_;
  double pct_;
  std::vector<double> true_nm_;
  Metrics metrics_;
};

}  // namespace

EstimateSeries to_estimate(std::span<const LoopOutput> outputs) {
  EstimateSeries out;
  for (const auto& row : outputs) {
    const bool there = (row.present & LoopOutput::kCuttingTorque) != 0;
    out.time_s.push_back(static_cast<double>(row.time_ns) * 1e-9);
    out.torque_nm.push_back(there ? static_cast<double>(row.cutting_torque_nm) : kNan);
    out.sigma_nm.push_back(there ? static_cast<double>(row.cutting_torque_sigma_nm) : kNan);
  }
  return out;
}

Metrics score(const TruthSeries& truth, const LoadProfile& profile,
              const EstimateSeries& estimate) {
  if (truth.time_s.empty() || !(truth.rated_torque_nm > 0.0)) return {};
  return Scorer(truth, profile, estimate).run();
}

}  // namespace cutforce::firmware::host
