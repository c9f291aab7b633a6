#include "control/gain_tracker.hpp"

#include <algorithm>
#include <cmath>

#include "control/gain_tracker_tick.hpp"

namespace cutforce::control {
namespace {

constexpr float kModelSpread_ratio =
    0.06F;  // of a gain that was learned from a jump: the lags are not exact
constexpr float kBeginSpread_ratio = 0.2F;
constexpr float kLeastFeed = 0.01F;

}  // namespace

// The first reading of all: as if the force had been this for long.
void GainTracker::begin(float reading_n, float feed, float entry_n) noexcept {
  Own& s = own_;
  s.started = 1;
  if (!(reading_n > entry_n && feed > kLeastFeed)) return;
  s.air = 0;
  s.now.force_n = s.now.sensed_n = reading_n;
  s.now.gain_n = std::min(reading_n / feed, most_gain_n_);
  s.now.covariance[ForceBelief::kKK] = square(kBeginSpread_ratio * s.now.gain_n);
  s.now.covariance[ForceBelief::kFF] = square(kBeginSpread_ratio * s.now.force_n);
}

// A covariance far above that of a reading comes out indefinite in single precision: a variance
// below zero, and from it a reading's that has no root. No variance is below zero, and no
// correlation above one.
void GainTracker::make_sound() noexcept {
  using enum ForceBelief::Covariance;
  auto& covariance = own_.now.covariance;
  const auto spread = [&covariance](std::size_t k) {
    covariance[k] = std::max(covariance[k], 0.0F);
    return std::sqrt(covariance[k]);
  };
  const float f = spread(kFF);
  const float s = spread(kSS);
  const float k = spread(kKK);
  covariance[kFs] = std::clamp(covariance[kFs], -f * s, f * s);
  covariance[kFK] = std::clamp(covariance[kFK], -f * k, f * k);
  covariance[kSK] = std::clamp(covariance[kSK], -s * k, s * k);
}

void GainTracker::begin_jump(const JumpResolver::Reading& reading) noexcept {
  Own& s = own_;
  const JumpResolver::Point past = s.past;
  remember(reading);
  s.air = 0;
  jump_.begin(past, reading, s.memory_n, s.now);
  s.last_innovation = 0.0F;
  s.correlation = 0.0F;
}

// A jump that is being followed: one more reading. (C83)
auto GainTracker::follow_on(const JumpResolver::Reading& reading) noexcept
    -> JumpResolver::Outcome {
  Own& s = own_;
  const JumpResolver::Point past = s.past;
  remember(reading);
  s.last_innovation = 0.0F;
  const auto outcome = jump_.follow(past, reading, s.memory_n, s.now);
  if (outcome == JumpResolver::Outcome::kGivesUp) return outcome;
  s.correlation = 0.0F;
  if (jump_.finish())
    s.now.covariance[ForceBelief::kKK] += square(kModelSpread_ratio * s.now.gain_n);
  return outcome;
}

void GainTracker::restart() noexcept {
  const float memory_n = own_.memory_n;
  const float noise_scale = own_.noise_scale;
  own_ = Own{};
  jump_.restore({});
  own_.memory_n = memory_n;
  own_.noise_scale = noise_scale;
  settle_in_air();
}

void GainTracker::coast(float feed) noexcept {
  predict(own_.now, feed, 0.0F, kDrift_ratio_sqrt_s * sqrt_period_);
  if (!sound(own_.now)) make_sound();
  jump_.drop();
  own_.ticks = 0;
}

}  // namespace cutforce::control
