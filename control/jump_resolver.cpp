#include "control/jump_resolver.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace cutforce::control {
namespace {

constexpr float kJump_ratio = 1.0F;      // spread of a jump, of the gain
constexpr float kEntry_variance = 2.0F;  // of the first gain, of the square of the remembered one
constexpr float kFromAir_ratio = 0.05F;  // of the remembered gain: less is the air
constexpr float kNothing = 0.01F;        // probability that an alarm means nothing
constexpr float kEachMoment = (1.0F - kNothing) / static_cast<float>(JumpResolver::kMoments);
constexpr std::uint32_t kMostRestarts = 4;
constexpr float kBadFit = 9.0F;
constexpr float kBadFitEach = 4.0F;

constexpr float square(float x) noexcept { return x * x; }

// exp(-difference/2) of two misfits, nothing below 1e-9; relative error <= 1e-4. The misfits
// themselves are as uncertain as the noise, a tenth and more, and the prior is a guess.
float share_of(float difference) noexcept {
  constexpr float kHalfLogOfTwo = 0.72134752F;
  constexpr float kNegligible = -30.0F;
  constexpr float kRounder = 12582912.0F;  // 1.5 * 2^23, see polynomials.hpp
  const float x = kHalfLogOfTwo * difference;
  if (!(x > kNegligible)) return 0.0F;
  const float rounded = x + kRounder;
  const float r = x - (rounded - kRounder);
  const float power = ((5.5171672e-2F * r + 2.4261113e-1F) * r + 6.9326099e-1F) * r + 9.9992820e-1F;
  const auto whole = std::bit_cast<std::uint32_t>(rounded) << 23U;
  return std::bit_cast<float>(std::bit_cast<std::uint32_t>(power) + whole);
}

}  // namespace

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
  const float sharpness = 1.0F / variance_n2;
  const float pull = residual_n * sharpness;
  s.residual += residual_n * pull;
  return {.sharpness = sharpness, .pull = pull};
}

// The gain that fits a moment best, and how badly it still does; `misfit` is that of no gain. (C81)
inline void JumpResolver::fit(const Moment& moment, float misfit, Fit& fit, float& least) noexcept {
  const float jump_n = moment.pull / moment.sharpness;
  const float still = misfit - moment.pull * jump_n;
  fit.jump_n = jump_n;
  fit.misfit = still;
  least = std::min(least, still);
}

// Mean and spread over the moments and over "nothing happened". (C81), (C82)
//
// The probability of a moment is that of its misfit times the width that its gain may have, over
// that before: exp(-m/2) / sqrt(sharpness * variance), which a square root gives for a logarithm.
void JumpResolver::conclude(Fits& fits, ForceBelief& belief) const noexcept {
  const State& s = state_;
  const float nothing = kNothing / kEachMoment * share_of(fits.least - s.residual);
  float sum = nothing;
  float gain_n = 0.0F;
  float force_n = 0.0F;
  float sensed_n = 0.0F;
  for (std::size_t k = 0; k < kMoments; ++k) {
    const Moment& m = s.moments[k];
    Fit& fit = fits.of[k];
    fit.share = share_of(fits.least - fit.misfit) / std::sqrt(m.sharpness * s.prior_variance_n2);
    sum += fit.share;
    const float weighed_n = fit.share * fit.jump_n;
    gain_n += weighed_n;
    force_n += weighed_n * m.force;
    sensed_n += weighed_n * m.sensed;
  }
  const float scale = 1.0F / sum;
  gain_n *= scale;
  force_n *= scale;
  sensed_n *= scale;
  // "Nothing happened" stands for a jump of zero, whose variance is the base's.
  const float still_f = nothing * force_n;
  const float still_r = nothing * sensed_n;
  float ff = still_f * force_n;
  float fs = still_f * sensed_n;
  float fk = still_f * gain_n;
  float ss = still_r * sensed_n;
  float sk = still_r * gain_n;
  float kk = nothing * (square(gain_n) + s.base.variance_n2);
  for (std::size_t k = 0; k < kMoments; ++k) {
    const Moment& m = s.moments[k];
    const Fit& fit = fits.of[k];
    const float f = fit.jump_n * m.force - force_n;
    const float r = fit.jump_n * m.sensed - sensed_n;
    const float g = fit.jump_n - gain_n;
    const float variance_n2 = fit.share / m.sharpness;
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
  belief.covariance = {scale * ff, scale * fs, scale * fk, scale * ss, scale * sk, scale * kk};
  belief.gain_n = std::clamp(s.base.gain_n + gain_n, 0.0F, most_gain_n_);
  belief.force_n = s.base.force_n + force_n;
  belief.sensed_n = s.base.sensed_n + sensed_n;
}

void JumpResolver::begin(const Point& past, const Reading& now, float memory_n,
                         ForceBelief& belief) noexcept {
  state_.restarts = 0;
  Fits fits;
  start(past, now, memory_n, fits, belief);
}

// The two readings that there are since the jump, in one pass: the moments of the first tick have
// both, those of the second have the second alone.
void JumpResolver::start(const Point& past, const Reading& now, float memory_n, Fits& fits,
                         ForceBelief& belief) noexcept {
  State& s = state_;
  s.base = past;
  s.residual = 0.0F;
  s.timing_n2 = 0.0F;
  const bool from_air = !(past.gain_n > kFromAir_ratio * memory_n);
  const float variance_n2 =
      from_air ? kEntry_variance * square(memory_n) : square(kJump_ratio * past.gain_n);
  const float sharpness = 1.0F / variance_n2;
  const float pull = from_air ? memory_n * sharpness : 0.0F;
  s.prior_variance_n2 = variance_n2;
  s.prior_misfit = pull * memory_n;
  const Residual first = advance_base({.reading_n = past.reading_n,
                                       .feed = past.feed,
                                       .feed_sigma = past.feed_sigma,
                                       .noise_n2 = now.noise_n2},
                                      belief.gain_n);
  const Residual second = advance_base(now, belief.gain_n);
  const float misfit = s.prior_misfit + s.residual;
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
    early.pull = pull + sensed * first.pull + early.sensed * second.pull;
    early.sharpness =
        sharpness + square(sensed) * first.sharpness + square(early.sensed) * second.sharpness;
    fit(early, misfit, fits.of[k], least);

    Moment& late = s.moments[kMomentsOfTick + k];
    late.sensed = onset.sensed * now.feed;
    late.force = onset.force * now.feed;
    late.pull = pull + late.sensed * second.pull;
    late.sharpness = sharpness + square(late.sensed) * second.sharpness;
    fit(late, misfit, fits.of[kMomentsOfTick + k], least);
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
  const float misfit = s.prior_misfit + s.residual;
  Fits fits;
  float least = s.residual;
  const float push = left_ * now.feed;
  const float sensed_push = lag_.sensed_input * now.feed;
  for (std::size_t k = 0; k < kMoments; ++k) {
    Moment& m = s.moments[k];
    m.sensed = lag_.sensed * m.sensed + lag_.sensed_force * m.force + sensed_push;
    m.force = lag_.cut * m.force + push;
    m.pull += m.sensed * residual.pull;
    m.sharpness += square(m.sensed) * residual.sharpness;
    fit(m, misfit, fits.of[k], least);
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
  start(past, now, memory_n, fits, belief);
  return Outcome::kBeginsAgain;
}

}  // namespace cutforce::control
