#include "hal/host/simulation/force_sensor.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

namespace cutforce::hal::host {
namespace {

std::size_t whole_steps(double time_s, double step_s) noexcept {
  return static_cast<std::size_t>(std::floor(time_s / step_s + 0.5));
}

}  // namespace

ForceSensor::ForceSensor(const ForceSensorConfig& config, double step_s, double sample_s,
                         std::uint64_t seed)
    : gain_ratio_(config.gain_ratio),
      noise_ratio_(config.noise_ratio),
      noise_n_(config.noise_n),
      lag_share_(lag_share(step_s, config.lag_s)),
      memory_(1.0 - lag_share(sample_s, config.noise_correlation_s)),
      innovation_(std::sqrt(1.0 - memory_ * memory_)),
      late_n_(whole_steps(config.dead_time_s, step_s), 0.0),
      window_n_(
          config.mean_s > 0.0 ? std::max<std::size_t>(1, whole_steps(config.mean_s, step_s)) : 0,
          0.0),
      relative_(seed, 21),
      absolute_(seed, 22),
      relative_noise_(relative_.normal()),
      absolute_noise_(absolute_.normal()) {}

void ForceSensor::settle(double force_n) noexcept {
  std::ranges::fill(late_n_, force_n);
  std::ranges::fill(window_n_, force_n);
  sum_n_ = force_n * static_cast<double>(window_n_.size());
  value_n_ = force_n;
}

void ForceSensor::step(double force_n) noexcept {
  double now_n = force_n;
  if (!late_n_.empty()) {
    std::swap(now_n, late_n_[late_at_]);
    late_at_ = late_at_ + 1 < late_n_.size() ? late_at_ + 1 : 0;
  }
  if (window_n_.empty()) {
    value_n_ = lagged(value_n_, now_n, lag_share_);  // (S40)
    return;
  }
  sum_n_ += now_n - window_n_[window_at_];
  window_n_[window_at_] = now_n;
  if (++window_at_ == window_n_.size()) {
    window_at_ = 0;
    sum_n_ = std::accumulate(window_n_.begin(), window_n_.end(), 0.0);  // rounding does not add up
  }
  value_n_ = sum_n_ / static_cast<double>(window_n_.size());
}

double ForceSensor::read() noexcept {
  relative_noise_ = memory_ * relative_noise_ + innovation_ * relative_.normal();  // (S41)
  absolute_noise_ = memory_ * absolute_noise_ + innovation_ * absolute_.normal();
  return gain_ratio_ * value_n_ * (1.0 + noise_ratio_ * relative_noise_) +
         noise_n_ * absolute_noise_;
}

}  // namespace cutforce::hal::host
