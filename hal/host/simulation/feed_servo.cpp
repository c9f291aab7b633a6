#include "hal/host/simulation/feed_servo.hpp"

#include <cmath>
#include <cstddef>

namespace cutforce::hal::host {

FeedServo::FeedServo(const FeedConfig& config, double period_s, std::uint64_t seed)
    : config_(config),
      period_s_(period_s),
      lag_share_(lag_share(period_s, config.lag_s)),
      random_(seed, 1),
      latency_(static_cast<std::size_t>(std::floor(config.latency_s / period_s + 0.5)),
               config.initial_override_pct),
      wire_pct_(config.initial_override_pct),
      scanned_pct_(config.initial_override_pct),
      scan_due_s_(config.scan_s * random_.uniform()),
      next_scan_s_(scan_due_s_) {
  state_.override_pct = config.initial_override_pct;
}

double FeedServo::programmed_m_s(double spindle_turns_s) const noexcept {
  return config_.feed_m_rev > 0.0 ? config_.feed_m_rev * std::abs(spindle_turns_s)
                                  : config_.feed_m_s;
}

void FeedServo::settle(double spindle_turns_s) noexcept {
  state_.feed_m_s = 0.01 * config_.initial_override_pct * programmed_m_s(spindle_turns_s);
}

void FeedServo::step(double time_s, double spindle_turns_s) noexcept {
  if (!(config_.scan_s > 0.0)) {
    scanned_pct_ = wire_pct_;
  } else if (time_s >= next_scan_s_) {  // (S27)
    scanned_pct_ = wire_pct_;
    scan_due_s_ += config_.scan_s;
    next_scan_s_ = scan_due_s_ + config_.scan_jitter_s * random_.uniform();
  }
  state_.override_pct = latency_.push(scanned_pct_);  // (S28)

  state_.feeding = time_s >= config_.start_s && state_.position_m < config_.length_m;
  const double wanted_m_s =
      state_.feeding ? 0.01 * state_.override_pct * programmed_m_s(spindle_turns_s) : 0.0;
  // Exact for a constant command over the period, (S29).
  const double gap_m_s = state_.feed_m_s - wanted_m_s;
  state_.position_m += wanted_m_s * period_s_ + gap_m_s * config_.lag_s * lag_share_;
  state_.feed_m_s = lagged(state_.feed_m_s, wanted_m_s, lag_share_);
}

}  // namespace cutforce::hal::host
