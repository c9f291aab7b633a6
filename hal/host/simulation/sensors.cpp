#include "hal/host/simulation/sensors.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace cutforce::hal::host {
namespace {

std::size_t whole_steps(double time_s, double step_s, std::size_t least) {
  return std::max(least, static_cast<std::size_t>(std::floor(time_s / step_s + 0.5)));
}

}  // namespace

Channel::Channel(const ChannelConfig& config, std::uint64_t seed, std::uint64_t stream) noexcept
    : config_(config),
      step_(config.bits > 0.0 ? std::ldexp(2.0 * config.range, -static_cast<int>(config.bits))
                              : 0.0),
      random_(seed, stream) {}

double Channel::read(double value) noexcept {
  double x = config_.gain * value + config_.offset;
  if (config_.noise > 0.0) x += config_.noise * random_.normal();
  if (step_ > 0.0) x = step_ * std::floor(x / step_ + 0.5);
  if (config_.range > 0.0) x = std::clamp(x, -config_.range, config_.range - step_);
  return x;
}

SpeedSensor::SpeedSensor(const SpeedSensorConfig& config, double sample_s, std::uint64_t seed)
    : config_(config),
      lag_share_(lag_share(sample_s, config.lag_s)),
      window_s_(static_cast<double>(whole_steps(config.encoder_window_s, sample_s, 1)) * sample_s),
      random_(seed, 20),
      counts_(whole_steps(config.encoder_window_s, sample_s, 1), 0.0) {}

double SpeedSensor::read(double speed_rad_s, double angle_rad) noexcept {
  const bool ripples = config_.ripple_ratio != 0.0 || config_.second_ripple_ratio != 0.0;
  const auto [sine, cosine] = ripples ? sine_cosine(angle_rad) : SineCosine{0.0, 1.0};
  double measured = speed_rad_s;
  if (config_.encoder_counts > 0.0) {
    const double seen_rad =
        angle_rad + config_.ripple_ratio * sine + config_.second_ripple_ratio * sine * cosine;
    const double count = std::floor(seen_rad * config_.encoder_counts / kTwoPi);
    measured = (count - counts_.push(count)) * kTwoPi / config_.encoder_counts / window_s_;
  } else if (ripples) {
    measured = speed_rad_s * (1.0 + config_.ripple_ratio * cosine +
                              config_.second_ripple_ratio * (cosine * cosine - sine * sine));
  }
  lagged_rad_s_ = lagged(lagged_rad_s_, measured, lag_share_);
  if (!(config_.noise_rad_s > 0.0)) return lagged_rad_s_;
  return lagged_rad_s_ + config_.noise_rad_s * random_.normal();
}

PowerMeter::PowerMeter(const PowerMeterConfig& config, double period_s, std::uint64_t seed)
    : config_(config),
      periods_(static_cast<int>(whole_steps(config.period_s, period_s, 1))),
      lag_share_(lag_share(periods_ * period_s, config.lag_s)),
      random_(seed, 21),
      dead_time_(whole_steps(config.dead_time_s, periods_ * period_s, 0), 0.0) {}

void PowerMeter::step(double power_w) noexcept {
  sum_w_ += power_w;
  if (++count_ < periods_) return;
  const double mean_w = sum_w_ / count_;
  sum_w_ = 0.0;
  count_ = 0;
  lagged_w_ = lagged(lagged_w_, dead_time_.push(mean_w), lag_share_);
  output_w_ = config_.scale * lagged_w_ + config_.offset_w;
  if (config_.noise_w > 0.0) output_w_ += config_.noise_w * random_.normal();
}

}  // namespace cutforce::hal::host
