#include "firmware/host/compare/part_metrics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace cutforce::firmware::host {

PartScore::PartScore(const Config& config)
    : config_(config),
      window_(config.mean_s > 0.0
                  ? static_cast<std::size_t>(std::max(1.0, config.mean_s / config.step_s + 0.5))
                  : 0,
              0.0) {}

double PartScore::judged_n(double force_n) {
  if (window_.empty()) return force_n;
  window_sum_ += force_n - window_[window_at_];
  window_[window_at_] = force_n;
  window_at_ = (window_at_ + 1) % window_.size();
  return window_sum_ / static_cast<double>(window_.size());
}

void PartScore::step(const Step& step) {
  const double dt = config_.step_s;
  const double force_n = judged_n(step.force_n);
  const double above_n = force_n - config_.reference_n;
  sums_.time_s = step.time_s;
  sums_.peak_ratio = std::max(sums_.peak_ratio, force_n / config_.reference_n);
  sums_.impulse_ns += std::max(above_n, 0.0) * dt;
  sums_.impulse_105_ns += std::max(force_n - 1.05 * config_.reference_n, 0.0) * dt;
  if (force_n > 1.10 * config_.reference_n) sums_.above_110_s += dt;
  if (step.in_cut && step.override_pct < config_.ceiling_pct - 0.5) {
    sums_.shortfall_ns += std::max(-above_n, 0.0) * dt;
    square_ += above_n * above_n * dt;
    sums_.mean_ratio += force_n * dt;
    held_s_ += dt;
  }
  const bool watched = config_.settle_from_m >= 0.0 && step.position_m >= config_.settle_from_m &&
                       step.position_m < config_.settle_to_m;
  if (!watched) return;
  if (event_s_ < 0.0) event_s_ = outside_s_ = step.time_s;
  if (std::abs(above_n) > 0.05 * config_.reference_n) outside_s_ = step.time_s;
}

void PartScore::sent(double override_pct) {
  if (last_sent_pct_ >= 0.0 && override_pct != last_sent_pct_) sums_.changes += 1.0;
  last_sent_pct_ = override_pct;
}

PartMetrics PartScore::metrics(bool finished) const {
  PartMetrics m = sums_;
  m.finished = finished;
  if (held_s_ > 0.0) {
    m.rms_ratio = std::sqrt(square_ / held_s_) / config_.reference_n;
    m.mean_ratio /= held_s_ * config_.reference_n;
  }
  if (event_s_ >= 0.0) m.settling_s = outside_s_ - event_s_;
  return m;
}

PartMetrics total(const std::vector<PartMetrics>& metrics) {
  PartMetrics sum{};
  sum.finished = true;
  double rms = 0.0;
  for (const PartMetrics& m : metrics) {
    sum.peak_ratio = std::max(sum.peak_ratio, m.peak_ratio);
    sum.settling_s = std::max(sum.settling_s, m.settling_s);
    sum.impulse_ns += m.impulse_ns;
    sum.impulse_105_ns += m.impulse_105_ns;
    sum.shortfall_ns += m.shortfall_ns;
    sum.above_110_s += m.above_110_s;
    sum.time_s += m.time_s;
    sum.changes += m.changes;
    sum.mean_ratio += m.mean_ratio / static_cast<double>(metrics.size());
    rms += m.rms_ratio * m.rms_ratio / static_cast<double>(metrics.size());
    sum.finished = sum.finished && m.finished;
  }
  sum.rms_ratio = std::sqrt(rms);
  return sum;
}

}  // namespace cutforce::firmware::host
