// How the predictive law is made from its config, so that the compiler can do it: a board whose
// machine is compiled in starts from a constant (firmware/cortex_m/main.cpp).
#pragma once

#include <algorithm>
#include <array>
#include <expected>

#include "control/predictive.hpp"

namespace cutforce::control {
namespace detail {

inline constexpr float kAfterJump_1_s = 4.835F;  // faster recovery while a jump is being learned
inline constexpr float kMiddle_s = 0.2F;
inline constexpr float kLongestLatency_s = 0.4F;
inline constexpr float kMostTicks = static_cast<float>(Predictive::kHistory - 2);
inline constexpr float kDoubtMemory_s = 20.0F;
inline constexpr float kTrendMemory_s = 0.25F;

[[nodiscard]] constexpr LagStep lag_step(const Predictive::Config& config,
                                         float length_s) noexcept {
  return LagStep::of(length_s, config.feed_lag_s, config.process_lag_s, config.sensor_lag_s);
}

[[nodiscard]] constexpr GainTracker::Config tracker_config(
    const Predictive::Config& config) noexcept {
  return {.period_s = config.period_s,
          .cut_lag_s = config.process_lag_s,
          .sensor_lag_s = config.sensor_lag_s,
          .gain_n = config.process_gain_n,
          .noise_ratio = config.noise_ratio,
          .noise_n = config.noise_n,
          .jump_threshold = config.jump_threshold};
}

[[nodiscard]] constexpr PathMap::Config map_config(const Predictive::Config& config) noexcept {
  return {.period_s = config.period_s,
          .feed_lag_s = config.feed_lag_s,
          .sensor_lag_s = config.sensor_lag_s,
          .feed_exponent = config.feed_exponent,
          .gain_n = config.process_gain_n};
}

[[nodiscard]] constexpr LatencyBank::Config bank_config(const Predictive::Config& config) noexcept {
  return {.period_s = config.period_s,
          .latency_s = config.latency_s,
          .most_latency_s = std::min(kLongestLatency_s, kMostTicks * config.period_s),
          .feed_lag_s = config.feed_lag_s,
          .cut_lag_s = config.process_lag_s,
          .sensor_lag_s = config.sensor_lag_s};
}

}  // namespace detail

constexpr std::expected<void, Predictive::ConfigError> Predictive::Config::check() const noexcept {
  const auto fail = [](ConfigError error) { return std::unexpected{error}; };
  if (!(period_s > 0.0F && period_s <= 10.0F)) return fail(ConfigError::kPeriod);
  if (!(latency_s >= 0.0F && latency_s <= static_cast<float>(kHistory - 2) * period_s))
    return fail(ConfigError::kLatency);
  if (!(latency_sigma_s >= 0.0F && latency_sigma_s <= 1.0F)) return fail(ConfigError::kLatency);
  if (!(feed_lag_s >= 0.0F && feed_lag_s <= 10.0F && process_lag_s > 0.0F &&
        process_lag_s <= 10.0F && sensor_lag_s >= 0.0F && sensor_lag_s <= 10.0F &&
        apart(process_lag_s, feed_lag_s) && apart(process_lag_s, sensor_lag_s)))
    return fail(ConfigError::kLags);
  if (!(feed_exponent >= 0.3F && feed_exponent <= 1.5F)) return fail(ConfigError::kExponent);
  if (!(process_gain_n > 0.0F && process_gain_n <= 1e7F)) return fail(ConfigError::kGain);
  if (!(noise_ratio >= 0.0F && noise_ratio < 1.0F && noise_n > 0.0F && noise_n <= 1e6F))
    return fail(ConfigError::kNoise);
  if (!(jump_threshold >= 2.0F && jump_threshold <= 20.0F)) return fail(ConfigError::kThreshold);
  if (!(calm_horizon_s >= 2.0F * period_s && calm_horizon_s <= 100.0F))
    return fail(ConfigError::kHorizon);
  if (!(recovery_1_s > 0.0F && recovery_1_s <= 100.0F)) return fail(ConfigError::kRecovery);
  if (!(caution_ratio >= 0.0F && caution_ratio <= 3.0F)) return fail(ConfigError::kCaution);
  if (!(floor_pct >= 0.0F && floor_pct < ceiling_pct && ceiling_pct <= 254.0F) ||
      (step_pct != 1 && step_pct != 10))
    return fail(ConfigError::kRange);
  return {};
}

constexpr Predictive::Predictive(const Config& config) noexcept
    : config_(config),
      tick_(detail::lag_step(config, config.period_s)),
      latency_sigma_ratio_(config.latency_sigma_s / config.period_s),
      inverse_exponent_(1.0F / config.feed_exponent),
      step_pct_(static_cast<float>(config.step_pct)),
      forgets_ratio_(estimator::exp_bounded(-config.recovery_1_s * config.period_s)),
      forgets_after_jump_ratio_(estimator::exp_bounded(-detail::kAfterJump_1_s * config.period_s)),
      doubt_share_(config.period_s / detail::kDoubtMemory_s),
      trend_share_(config.period_s / (detail::kTrendMemory_s + config.period_s)),
      tracker_(GainTracker::make_checked(detail::tracker_config(config))),
      bank_(LatencyBank::make_checked(detail::bank_config(config))),
      map_(PathMap::make_checked(detail::map_config(config))) {
  const std::array<float, kReaches> lengths{config.period_s, 2.0F * config.period_s,
                                            std::max(detail::kMiddle_s, 2.0F * config.period_s),
                                            config.calm_horizon_s};
  for (std::size_t k = 0; k < kReaches; ++k) {
    const LagStep h = detail::lag_step(config, lengths[k]);
    const float apart_s = config.feed_lag_s - config.process_lag_s;
    const float feed = (h.feed - h.cut) * config.feed_lag_s / apart_s;
    horizons_[k] = {
        .force = h.cut, .feed = feed, .command = 1.0F - h.cut - feed, .stable_gain_ratio = 1.0F};
  }
  assume_latency(config.latency_s);
  own_.sent.fill(1.0F);
  own_.feed.v = 1.0F;
}

constexpr void Predictive::assume_latency(float latency_s) noexcept {  // (C71)
  whole_ticks_ = static_cast<std::uint32_t>(latency_s / config_.period_s + 1e-4F);
  const float early_s =
      std::max(latency_s - static_cast<float>(whole_ticks_) * config_.period_s, 0.0F);
  early_ = detail::lag_step(config_, early_s);
  late_ = detail::lag_step(config_, config_.period_s - early_s);
  early_share_ = early_.length_s / config_.period_s;
  late_share_ = late_.length_s / config_.period_s;
  ahead_s_ = latency_s + config_.period_s + 0.5F * config_.process_lag_s;
  const float dead_decay = estimator::exp_bounded(-latency_s / config_.process_lag_s);
  const float decay = tick_.cut;
  for (Horizon& horizon : horizons_) {  // (C104)
    const float loop = horizon.force / (1.0F - horizon.force) * (1.0F - decay);
    horizon.stable_gain_ratio =
        1.0F + (1.0F - estimator::magnitude(decay - loop)) / (loop * dead_decay);
  }
}

}  // namespace cutforce::control
