// The tick of the gain tracker, for who calls it: it becomes one function with the law's
// (predictive.cpp), its nine numbers in registers from the prediction to the correction. What is
// rare is in gain_tracker.cpp.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "control/gain_tracker.hpp"

namespace cutforce::control {

// (C76), (C77)
inline void GainTracker::predict(ForceBelief& x, float feed, float feed_sigma,
                                 float drift) const noexcept {
  using enum ForceBelief::Covariance;
  const float drive = x.gain_n * feed;
  x.sensed_n = lag_.sensed * x.sensed_n + lag_.sensed_force * x.force_n + lag_.sensed_input * drive;
  x.force_n = lag_.cut * x.force_n + left_ * drive;

  const float fk = left_ * feed;
  const float sk = lag_.sensed_input * feed;
  const float ff = lag_.cut;
  const float sf = lag_.sensed_force;
  const float ss = lag_.sensed;
  const auto p = x.covariance;
  // Rows of A P.
  const float f_f = ff * p[kFF] + fk * p[kFK];
  const float f_s = ff * p[kFs] + fk * p[kSK];
  const float f_k = ff * p[kFK] + fk * p[kKK];
  const float s_f = sf * p[kFF] + ss * p[kFs] + sk * p[kFK];
  const float s_s = sf * p[kFs] + ss * p[kSS] + sk * p[kSK];
  const float s_k = sf * p[kFK] + ss * p[kSK] + sk * p[kKK];
  // An unknown moment moves force and reading together.
  const float force_n = left_ * x.gain_n * feed_sigma;
  const float sensed_n = lag_.sensed_input * x.gain_n * feed_sigma;
  x.covariance = {ff * f_f + fk * f_k + force_n * force_n,
                  sf * f_f + ss * f_s + sk * f_k + force_n * sensed_n,
                  f_k,
                  sf * s_f + ss * s_s + sk * s_k + sensed_n * sensed_n,
                  s_k,
                  p[kKK] + square(drift * x.gain_n)};
}

// (C78)
inline void GainTracker::correct(ForceBelief& x, float innovation_n, float variance_n2) noexcept {
  using enum ForceBelief::Covariance;
  const auto p = x.covariance;
  const float over = 1.0F / variance_n2;
  const float gain_f = p[kFs] * over;
  const float gain_s = p[kSS] * over;
  const float gain_k = p[kSK] * over;
  x.force_n += gain_f * innovation_n;
  x.sensed_n += gain_s * innovation_n;
  x.gain_n += gain_k * innovation_n;
  x.covariance = {p[kFF] - gain_f * p[kFs], p[kFs] - gain_f * p[kSS], p[kFK] - gain_f * p[kSK],
                  p[kSS] - gain_s * p[kSS], p[kSK] - gain_s * p[kSK], p[kKK] - gain_k * p[kSK]};
}

// Whether no variance is below zero and no correlation above one. Nearly always; products tell it
// without roots: no sign bit among the variances, and no square of a covariance near their product.
inline bool GainTracker::sound(const ForceBelief& x) noexcept {
  using enum ForceBelief::Covariance;
  constexpr float kNear = 1.0F - 1e-6F;  // more than what the roots are rounded by
  const auto& c = x.covariance;
  const auto bits = [&c](std::size_t k) { return std::bit_cast<std::uint32_t>(c[k]); };
  const float f = kNear * c[kFF];
  const float s = kNear * c[kSS];
  return (bits(kFF) | bits(kSS) | bits(kKK)) >> 31U == 0 && square(c[kFs]) <= f * c[kSS] &&
         square(c[kFK]) <= f * c[kKK] && square(c[kSK]) <= s * c[kKK];
}

inline float GainTracker::trend() const noexcept {
  const Own& s = own_;
  return s.correlation > 0.0F ? std::min(s.correlation / std::max(s.power, 0.5F), 1.0F) : 0.0F;
}

inline bool GainTracker::surprises(const Input& input, float innovation,
                                   float innovation_n) const noexcept {  // (C79)
  const Own& s = own_;
  if (s.ticks == 0) return false;
  const float size = estimator::magnitude(innovation);
  const bool surprise =
      size > twice_threshold_ &&
      (size > jump_threshold_ || (innovation * s.last_innovation > 0.0F &&
                                  estimator::magnitude(s.last_innovation) > twice_threshold_));
  if (s.air == 0) return surprise;
  return !input.air || innovation_n > input.entry_n || (surprise && innovation_n > 0.0F);
}

// What a calm reading tells of trend, noise and the gain to remember.
inline void GainTracker::note_calm(float innovation, bool drifts) noexcept {
  Own& s = own_;
  const float power = square(innovation);
  s.correlation += memory_share_ * (innovation * s.last_innovation - s.correlation);
  s.power += memory_share_ * (power - s.power);
  s.last_innovation = innovation;
  if (s.air != 0) return;
  if (estimator::magnitude(innovation) < kUsual && !drifts) {
    s.noise_scale =
        std::clamp(s.noise_scale * (noise_kept_ + noise_share_ * power), kQuietest, kLoudest);
  }
  if (s.now.covariance[ForceBelief::kKK] < square(kSettled_ratio * s.now.gain_n))
    s.memory_n = s.now.gain_n;
}

// To start again from, should the next reading surprise.
inline void GainTracker::remember(const JumpResolver::Reading& reading) noexcept {
  Own& s = own_;
  s.past = {.force_n = s.now.force_n,
            .sensed_n = s.now.sensed_n,
            .gain_n = s.now.gain_n,
            .feed = reading.feed,
            .feed_sigma = reading.feed_sigma,
            .reading_n = reading.reading_n,
            .variance_n2 = s.now.covariance[ForceBelief::kKK]};
  s.ticks = 1;
}

[[gnu::always_inline]] inline auto GainTracker::step(const Input& input) noexcept -> Output {
  Own& s = own_;
  if (s.started == 0) [[unlikely]] {
    begin(input.reading_n, input.feed, input.entry_n);
  }
  const bool follows = jump_.active();
  if (input.air && s.air == 0 && !follows) settle_in_air();
  const float trend = this->trend();
  const bool drifts = trend > kTrendFloor;
  const float noise_n2 = s.noise_scale * (square(noise_ratio_ * input.reading_n) + noise_n2_);
  const auto reading = [&] {  // a copy each: what is handed on by address is not in registers
    return JumpResolver::Reading{.reading_n = input.reading_n,
                                 .feed = input.feed,
                                 .feed_sigma = input.feed_sigma,
                                 .noise_n2 = noise_n2};
  };
  bool jumped = false;
  bool resolving = follows;
  float innovation = 0.0F;
  if (follows) [[unlikely]] {
    const auto outcome = follow_on(reading());
    jumped = outcome == JumpResolver::Outcome::kBeginsAgain;
    if (outcome == JumpResolver::Outcome::kGivesUp) {
      begin(input.reading_n, input.feed, input.entry_n);
      resolving = false;
    }
  } else {
    const float more = drifts ? kTrend_ratio_sqrt_s * (trend - kTrendFloor) : 0.0F;
    ForceBelief x = s.now;
    predict(x, input.feed, input.feed_sigma, (kDrift_ratio_sqrt_s + more) * sqrt_period_);
    float& sensed_n2 = x.covariance[ForceBelief::kSS];
    sensed_n2 = std::max(sensed_n2, 0.0F);  // what else is unsound waits for the correction
    const float innovation_n = input.reading_n - x.sensed_n;
    const float variance_n2 = sensed_n2 + noise_n2;
    innovation = innovation_n / std::sqrt(variance_n2);
    if (surprises(input, innovation, innovation_n)) [[unlikely]] {
      begin_jump(reading());
      jumped = resolving = true;
    } else {
      correct(x, innovation_n, variance_n2);
      x.gain_n = up_to(x.gain_n, most_gain_n_);
      remember(reading());
      s.now = x;
      if (!sound(x)) [[unlikely]] {
        make_sound();
      }
      note_calm(innovation, drifts);
    }
  }
  return {.force_n = std::max(s.now.force_n, 0.0F),
          .gain_n = s.now.gain_n,
          .gain_sigma_n = std::sqrt(s.now.covariance[ForceBelief::kKK]),
          .trend = trend,
          .innovation = innovation,
          .jumped = jumped,
          .resolving = resolving,
          .rising = jump_.rising()};
}

}  // namespace cutforce::control
