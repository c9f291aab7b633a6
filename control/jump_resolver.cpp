#include "control/jump_resolver.hpp"

#include <algorithm>
#include <cmath>

namespace cutforce::control {
namespace {

using estimator::exp_bounded;

constexpr float kJump_ratio = 1.0F;      // spread of a jump, of the gain
constexpr float kEntry_variance = 2.0F;  // of the first gain, of the square of the remembered one
constexpr float kFromAir_ratio = 0.05F;  // of the remembered gain: less is the air
constexpr float kNothing = 0.01F;        // probability that an alarm means nothing
constexpr float kEachMoment = (1.0F - kNothing) / static_cast<float>(JumpResolver::kMoments);
constexpr std::uint32_t kMostRestarts = 4;
constexpr float kBadFit = 9.0F;
constexpr float kBadFitEach = 4.0F;
constexpr std::array<float, JumpResolver::kMomentsOfTick> kOnset{0.05F, 0.35F, 0.7F};  // of a tick

constexpr float square(float x) noexcept { return x * x; }

}  // namespace

JumpResolver::JumpResolver(const Config& config) noexcept
    : lag_(LagStep::of(config.period_s, 0.0F, config.cut_lag_s, config.sensor_lag_s)),
      left_(1.0F - lag_.cut),
      most_gain_n_(config.most_gain_n) {
  for (std::size_t k = 0; k < kMomentsOfTick; ++k) {
    const auto rest = LagStep::of((1.0F - kOnset[k]) * config.period_s, 0.0F, config.cut_lag_s,
                                  config.sensor_lag_s);
    onsets_[k] = {.force = 1.0F - rest.cut, .sensed = rest.sensed_input};
  }
}

// The open loop goes one tick on. (C80)
inline auto JumpResolver::advance_base(const Reading& reading, float gain_n) noexcept -> Residual {
  State& s = state_;
  // What an unknown moment did to the force is still there when the next readings come.
  s.timing_n2 = square(lag_.cut) * s.timing_n2 +
                square(lag_.sensed_input * std::max(gain_n, s.base.gain_n) * reading.feed_sigma);
  const float variance_n2 = reading.noise_n2 + s.timing_n2;
  const float drive = s.base.gain_n * reading.feed;
  s.base.sensed_n = lag_.sensed * s.base.sensed_n + lag_.sensed_force * s.base.force_n +
                    lag_.sensed_input * drive;
  s.base.force_n = lag_.cut * s.base.force_n + left_ * drive;
  const float residual_n = reading.reading_n - s.base.sensed_n;
  s.residual += square(residual_n) / variance_n2;
  return {.n = residual_n, .variance_n2 = variance_n2};
}

inline auto JumpResolver::prior() const noexcept -> Prior {
  const State& s = state_;
  const float sharpness = 1.0F / s.prior_variance_n2;
  return {.sharpness = sharpness,
          .pull = s.prior_mean_n * sharpness,
          .misfit = square(s.prior_mean_n) * sharpness + s.residual};
}

// The gain that fits a moment best, and how badly it still does. (C81)
inline void JumpResolver::fit(const Moment& moment, const Prior& prior, Fit& fit,
                              float& least) noexcept {
  fit.sharpness = prior.sharpness + moment.weight;
  fit.jump_n = (prior.pull + moment.fit) / fit.sharpness;
  fit.misfit = prior.misfit - fit.sharpness * square(fit.jump_n);
  least = std::min(least, fit.misfit);
}

// Mean and spread over the moments and over "nothing happened". (C81), (C82)
//
// The probability of a moment is that of its misfit times the width that its gain may have, over
// that before: exp(-m/2) / sqrt(sharpness * variance), which a square root gives for a logarithm.
void JumpResolver::conclude(Fits& fits, ForceBelief& belief) const noexcept {
  const State& s = state_;
  const float nothing = kNothing * exp_bounded(0.5F * (fits.least - s.residual));
  float sum = nothing;
  for (Fit& fit : fits.of) {
    fit.share = kEachMoment * exp_bounded(0.5F * (fits.least - fit.misfit)) /
                std::sqrt(fit.sharpness * s.prior_variance_n2);
    sum += fit.share;
  }
  const float scale = 1.0F / sum;
  float gain_n = 0.0F;
  float force_n = 0.0F;
  float sensed_n = 0.0F;
  for (std::size_t k = 0; k < kMoments; ++k) {
    fits.of[k].share *= scale;
    const Moment& m = s.moments[k];
    const float weighed_n = fits.of[k].share * fits.of[k].jump_n;
    gain_n += weighed_n;
    force_n += weighed_n * m.force;
    sensed_n += weighed_n * m.sensed;
  }
  // "Nothing happened" stands for a jump of zero, whose variance is the base's.
  const float still = nothing * scale;
  float ff = still * square(force_n);
  float fs = still * force_n * sensed_n;
  float fk = still * force_n * gain_n;
  float ss = still * square(sensed_n);
  float sk = still * sensed_n * gain_n;
  float kk = still * (square(gain_n) + s.base.variance_n2);
  for (std::size_t k = 0; k < kMoments; ++k) {
    const Moment& m = s.moments[k];
    const Fit& fit = fits.of[k];
    const float f = fit.jump_n * m.force - force_n;
    const float r = fit.jump_n * m.sensed - sensed_n;
    const float g = fit.jump_n - gain_n;
    const float variance_n2 = fit.share / fit.sharpness;
    const float variance_f = variance_n2 * m.force;
    const float variance_r = variance_n2 * m.sensed;
    const float share_f = fit.share * f;
    const float share_r = fit.share * r;
    ff += share_f * f + variance_f * m.force;
    fs += share_f * r + variance_f * m.sensed;
    fk += share_f * g + variance_f;
    ss += share_r * r + variance_r * m.sensed;
    sk += share_r * g + variance_r;
    kk += fit.share * g * g + variance_n2;
  }
  belief.covariance = {ff, fs, fk, ss, sk, kk};
  belief.gain_n = std::clamp(s.base.gain_n + gain_n, 0.0F, most_gain_n_);
  belief.force_n = s.base.force_n + force_n;
  belief.sensed_n = s.base.sensed_n + sensed_n;
}

void JumpResolver::begin(const Point& past, const Reading& now, float memory_n,
                         ForceBelief& belief) noexcept {
  state_.restarts = 0;
  start(past, now, memory_n, belief);
}

// The two readings that there are since the jump, in one pass: the moments of the first tick have
// both, those of the second have the second alone.
void JumpResolver::start(const Point& past, const Reading& now, float memory_n,
                         ForceBelief& belief) noexcept {
  State& s = state_;
  s.base = past;
  s.residual = 0.0F;
  s.timing_n2 = 0.0F;
  const bool from_air = !(past.gain_n > kFromAir_ratio * memory_n);
  s.prior_mean_n = from_air ? memory_n : 0.0F;
  s.prior_variance_n2 =
      from_air ? kEntry_variance * square(memory_n) : square(kJump_ratio * past.gain_n);
  const Residual first = advance_base({.reading_n = past.reading_n,
                                       .feed = past.feed,
                                       .feed_sigma = past.feed_sigma,
                                       .noise_n2 = now.noise_n2},
                                      belief.gain_n);
  const Residual second = advance_base(now, belief.gain_n);
  const Prior before = prior();
  Fits fits;
  float least = s.residual;
  const float push = left_ * now.feed;
  const float sensed_push = lag_.sensed_input * now.feed;
  for (std::size_t k = 0; k < kMomentsOfTick; ++k) {
    const Onset& onset = onsets_[k];
    Moment& early = s.moments[k];
    const float sensed = onset.sensed * past.feed;
    const float force = onset.force * past.feed;
    early.sensed = lag_.sensed * sensed + lag_.sensed_force * force + sensed_push;
    early.force = lag_.cut * force + push;
    early.fit = sensed * first.n / first.variance_n2 + early.sensed * second.n / second.variance_n2;
    early.weight = square(sensed) / first.variance_n2 + square(early.sensed) / second.variance_n2;
    fit(early, before, fits.of[k], least);

    Moment& late = s.moments[kMomentsOfTick + k];
    late.sensed = onset.sensed * now.feed;
    late.force = onset.force * now.feed;
    late.fit = late.sensed * second.n / second.variance_n2;
    late.weight = square(late.sensed) / second.variance_n2;
    fit(late, before, fits.of[kMomentsOfTick + k], least);
  }
  fits.least = least;
  s.samples = kTicks;
  conclude(fits, belief);
  s.rising = belief.gain_n > s.base.gain_n ? 1U : 0U;
}

// One more reading; it begins again where no moment explains them all. (C83)
auto JumpResolver::follow(const Point& past, const Reading& now, float memory_n,
                          ForceBelief& belief) noexcept -> Outcome {
  State& s = state_;
  ++s.samples;
  const Residual residual = advance_base(now, belief.gain_n);
  const Prior before = prior();
  Fits fits;
  float least = s.residual;
  const float push = left_ * now.feed;
  const float sensed_push = lag_.sensed_input * now.feed;
  for (std::size_t k = 0; k < kMoments; ++k) {
    Moment& m = s.moments[k];
    m.sensed = lag_.sensed * m.sensed + lag_.sensed_force * m.force + sensed_push;
    m.force = lag_.cut * m.force + push;
    m.fit += m.sensed * residual.n / residual.variance_n2;
    m.weight += square(m.sensed) / residual.variance_n2;
    fit(m, before, fits.of[k], least);
  }
  fits.least = least;
  if (!(least > kBadFit + kBadFitEach * static_cast<float>(s.samples))) {
    conclude(fits, belief);
    return Outcome::kFollows;
  }
  // Look again from here, and in the end give up the model's past.
  if (++s.restarts > kMostRestarts) {
    conclude(fits, belief);
    s.samples = 0;
    return Outcome::kGivesUp;
  }
  start(past, now, memory_n, belief);
  return Outcome::kBeginsAgain;
}

}  // namespace cutforce::control
