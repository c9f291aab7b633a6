#include "control/gain_tracker.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace cutforce::control {
namespace {

using estimator::exp_bounded;
using estimator::magnitude;
using namespace detail;  // Covariance

constexpr float kDrift_ratio_sqrt_s = 0.018F;  // of the gain, in a steady cut
constexpr float kTrend_ratio_sqrt_s = 0.168F;  // more of it for each unit of trend
constexpr float kTrendFloor = 0.1F;
constexpr float kTrendMemory_s = 0.25F;
constexpr float kTwiceThreshold_ratio = 0.81F;  // two readings in a row need this of the threshold
constexpr float kJump_ratio = 1.0F;             // spread of a jump, of the gain
constexpr float kEntry_variance = 2.0F;  // of the first gain, of the square of the remembered one
constexpr float kSettled_ratio = 0.1F;   // spread of a gain that is remembered
constexpr float kModelSpread_ratio =
    0.06F;  // of a gain that was learned from a jump: the lags are not exact
// The noise is matched to what is seen in a calm cut: a variance over the configured one.
constexpr float kNoiseMemory_s = 20.0F;
constexpr float kUsual = 3.0F;       // standard deviations; more is no noise
constexpr float kUsualPower = 0.9F;  // of a normal variable that is cut off there, less a margin
constexpr float kQuietest = 1.0F;    // what the config says, at least
constexpr float kLoudest = 10.0F;
constexpr float kBeginSpread_ratio = 0.2F;
constexpr float kLeastFeed = 0.01F;
constexpr float kMostGain_ratio = 1000.0F;  // of the config's: no cut
constexpr float kNothing = 0.01F;           // probability that an alarm means nothing
constexpr float kEachMoment = (1.0F - kNothing) / static_cast<float>(GainTracker::kMoments);
constexpr std::uint32_t kMostRestarts = 4;
constexpr float kBadFit = 9.0F;
constexpr float kBadFitEach = 4.0F;

constexpr float square(float x) noexcept { return x * x; }

// A covariance far above that of a reading comes out indefinite in single precision: a variance
// below zero, and from it a reading's that has no root. No variance is below zero, and no
// correlation above one.
void make_sound(std::array<float, 6>& covariance) noexcept {
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

// Nearly always there is nothing to do, which products tell without roots: no sign bit among the
// variances, and no square of a covariance near their product. 25 instructions for 75 on a
// Cortex-M7, twice a tick.
void keep_sound(std::array<float, 6>& covariance) noexcept {
  constexpr float kNear = 1.0F - 1e-6F;  // more than what the roots are rounded by
  const auto& c = covariance;
  const auto bits = [&c](std::size_t k) { return std::bit_cast<std::uint32_t>(c[k]); };
  const float f = kNear * c[kFF];
  const float s = kNear * c[kSS];
  const bool sound = (bits(kFF) | bits(kSS) | bits(kKK)) >> 31U == 0 &&
                     square(c[kFs]) <= f * c[kSS] && square(c[kFK]) <= f * c[kKK] &&
                     square(c[kSK]) <= s * c[kKK];
  if (!sound) make_sound(covariance);
}

}  // namespace

// The first reading of all: as if the force had been this for long.
void GainTracker::begin(const Input& input) noexcept {
  State& s = state_;
  s.started = 1;
  if (!(input.reading_n > input.entry_n && input.feed > kLeastFeed)) return;
  s.air = 0;
  s.force_n = s.sensed_n = input.reading_n;
  s.gain_n = std::min(input.reading_n / input.feed, kMostGain_ratio * config_.gain_n);
  s.covariance[kKK] = square(kBeginSpread_ratio * s.gain_n);
  s.covariance[kFF] = square(kBeginSpread_ratio * s.force_n);
}

void GainTracker::predict(float feed, float feed_sigma, float drift) noexcept {  // (C76), (C77)
  State& s = state_;
  const float drive = s.gain_n * feed;
  s.sensed_n = lag_.sensed * s.sensed_n + lag_.sensed_force * s.force_n + lag_.sensed_input * drive;
  s.force_n = lag_.cut * s.force_n + (1.0F - lag_.cut) * drive;

  const float fk = (1.0F - lag_.cut) * feed;
  const float sk = lag_.sensed_input * feed;
  const float ff = lag_.cut;
  const float sf = lag_.sensed_force;
  const float ss = lag_.sensed;
  const auto p = s.covariance;
  // Rows of A P.
  const float f_f = ff * p[kFF] + fk * p[kFK];
  const float f_s = ff * p[kFs] + fk * p[kSK];
  const float f_k = ff * p[kFK] + fk * p[kKK];
  const float s_f = sf * p[kFF] + ss * p[kFs] + sk * p[kFK];
  const float s_s = sf * p[kFs] + ss * p[kSS] + sk * p[kSK];
  const float s_k = sf * p[kFK] + ss * p[kSK] + sk * p[kKK];
  s.covariance[kFF] = ff * f_f + fk * f_k;
  s.covariance[kFs] = sf * f_f + ss * f_s + sk * f_k;
  s.covariance[kFK] = f_k;
  s.covariance[kSS] = sf * s_f + ss * s_s + sk * s_k;
  s.covariance[kSK] = s_k;
  s.covariance[kKK] = p[kKK] + square(drift * s.gain_n);
  // An unknown moment moves force and reading together.
  const float force_n = (1.0F - lag_.cut) * s.gain_n * feed_sigma;
  const float sensed_n = lag_.sensed_input * s.gain_n * feed_sigma;
  s.covariance[kFF] += force_n * force_n;
  s.covariance[kFs] += force_n * sensed_n;
  s.covariance[kSS] += sensed_n * sensed_n;
  keep_sound(s.covariance);
}

void GainTracker::correct(float innovation_n, float variance_n2) noexcept {  // (C78)
  State& s = state_;
  const auto p = s.covariance;
  const float over = 1.0F / variance_n2;
  const float gain_f = p[kFs] * over;
  const float gain_s = p[kSS] * over;
  const float gain_k = p[kSK] * over;
  s.force_n += gain_f * innovation_n;
  s.sensed_n += gain_s * innovation_n;
  s.gain_n += gain_k * innovation_n;
  s.covariance = {p[kFF] - gain_f * p[kFs], p[kFs] - gain_f * p[kSS], p[kFK] - gain_f * p[kSK],
                  p[kSS] - gain_s * p[kSS], p[kSK] - gain_s * p[kSK], p[kKK] - gain_k * p[kSK]};
  keep_sound(s.covariance);
}

// The base and each moment's response go one tick on, and the reading is weighed. (C80), (C81)
void GainTracker::follow(float feed, float feed_sigma, float reading_n, float noise_n2,
                         std::uint32_t tick) noexcept {
  State& s = state_;
  // What an unknown moment did to the force is still there when the next readings come.
  s.timing_n2 = square(lag_.cut) * s.timing_n2 +
                square(lag_.sensed_input * std::max(s.gain_n, s.base.gain_n) * feed_sigma);
  const float variance_n2 = noise_n2 + s.timing_n2;
  const float drive = s.base.gain_n * feed;
  s.base.sensed_n = lag_.sensed * s.base.sensed_n + lag_.sensed_force * s.base.force_n +
                    lag_.sensed_input * drive;
  s.base.force_n = lag_.cut * s.base.force_n + (1.0F - lag_.cut) * drive;
  const float residual_n = reading_n - s.base.sensed_n;
  s.residual += square(residual_n) / variance_n2;
  const auto weigh = [residual_n, variance_n2](Moment& m) {
    m.fit += m.sensed * residual_n / variance_n2;
    m.weight += square(m.sensed) / variance_n2;
  };
  // Of each tick that has begun by now, the moments in it.
  for (std::size_t onset = 0; onset < kMoments / kOnset.size() && onset <= tick; ++onset) {
    Moment* const moments = &s.moments[onset * kOnset.size()];
    for (std::size_t k = 0; k < kOnset.size(); ++k) {
      Moment& m = moments[k];
      if (tick == onset) {
        m.sensed = partial_[k].sensed_input * feed;
        m.force = (1.0F - partial_[k].cut) * feed;
      } else {
        m.sensed = lag_.sensed * m.sensed + lag_.sensed_force * m.force + lag_.sensed_input * feed;
        m.force = lag_.cut * m.force + (1.0F - lag_.cut) * feed;
      }
      weigh(m);
    }
  }
}

// The gain that fits each moment best, and how badly it still does. (C81)
auto GainTracker::fit_moments() noexcept -> Fits {
  State& s = state_;
  const float prior = 1.0F / s.prior_variance_n2;
  const float pull = s.prior_mean_n * prior;
  const float least = square(s.prior_mean_n) * prior + s.residual;
  s.misfit = s.residual;
  Fits fits;
#pragma GCC unroll 6
  for (std::size_t k = 0; k < kMoments; ++k) {
    const Moment& m = s.moments[k];
    Fit& fit = fits[k];
    fit.sharpness = prior + m.weight;
    fit.jump_n = (pull + m.fit) / fit.sharpness;
    fit.misfit = least - fit.sharpness * square(fit.jump_n);
    s.misfit = std::min(s.misfit, fit.misfit);
  }
  return fits;
}

// Mean and spread over the moments and over "nothing happened". (C81), (C82)
//
// The probability of a moment is that of its misfit times the width that its gain may have, over
// that before: exp(-m/2) / sqrt(sharpness * variance), which a square root gives for a logarithm.
void GainTracker::conclude(const Fits& fits) noexcept {
  State& s = state_;
  std::array<float, kMoments> share;
  const float nothing = kNothing * exp_bounded(0.5F * (s.misfit - s.residual));
  float sum = nothing;
  for (std::size_t k = 0; k < kMoments; ++k) {
    share[k] = kEachMoment * exp_bounded(0.5F * (s.misfit - fits[k].misfit)) /
               std::sqrt(fits[k].sharpness * s.prior_variance_n2);
    sum += share[k];
  }
  const float scale = 1.0F / sum;
  float gain_n = 0.0F;
  float force_n = 0.0F;
  float sensed_n = 0.0F;
#pragma GCC unroll 6
  for (std::size_t k = 0; k < kMoments; ++k) {
    share[k] *= scale;
    const Moment& m = s.moments[k];
    const float weighed_n = share[k] * fits[k].jump_n;
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
    const Fit& fit = fits[k];
    const float f = fit.jump_n * m.force - force_n;
    const float r = fit.jump_n * m.sensed - sensed_n;
    const float g = fit.jump_n - gain_n;
    const float variance_n2 = share[k] / fit.sharpness;
    const float variance_f = variance_n2 * m.force;
    const float variance_r = variance_n2 * m.sensed;
    const float share_f = share[k] * f;
    const float share_r = share[k] * r;
    ff += share_f * f + variance_f * m.force;
    fs += share_f * r + variance_f * m.sensed;
    fk += share_f * g + variance_f;
    ss += share_r * r + variance_r * m.sensed;
    sk += share_r * g + variance_r;
    kk += share[k] * g * g + variance_n2;
  }
  s.covariance = {ff, fs, fk, ss, sk, kk};
  s.gain_n = std::clamp(s.base.gain_n + gain_n, 0.0F, kMostGain_ratio * config_.gain_n);
  s.force_n = s.base.force_n + force_n;
  s.sensed_n = s.base.sensed_n + sensed_n;
}

void GainTracker::begin_jump(const Input& input, float noise_n2) noexcept {
  State& s = state_;
  s.base = s.past;
  for (Moment& m : s.moments) m.fit = m.weight = 0.0F;  // force and sensed begin with their tick
  s.residual = 0.0F;
  const bool from_air = !(s.base.gain_n > 0.05F * s.memory_n);
  s.prior_mean_n = from_air ? s.memory_n : 0.0F;
  s.prior_variance_n2 =
      from_air ? kEntry_variance * square(s.memory_n) : square(kJump_ratio * s.base.gain_n);
  s.timing_n2 = 0.0F;
  follow(s.past.feed, s.past.feed_sigma, s.past.reading_n, noise_n2, 0);
  follow(input.feed, input.feed_sigma, input.reading_n, noise_n2, 1);
  s.samples = 2;
  conclude(fit_moments());
  s.rising = s.gain_n > s.base.gain_n ? 1U : 0U;
}

void GainTracker::restart() noexcept {
  const float memory_n = state_.memory_n;
  const float noise_scale = state_.noise_scale;
  state_ = State{};
  state_.memory_n = memory_n;
  state_.noise_scale = noise_scale;
  settle_in_air();
}

void GainTracker::coast(float feed) noexcept {
  predict(feed, 0.0F, kDrift_ratio_sqrt_s * std::sqrt(config_.period_s));
  state_.samples = 0;
  state_.ticks = 0;
}

// A jump that is being followed: one more reading. True iff it begins again. (C83)
bool GainTracker::follow_on(const Input& input, float noise_n2) noexcept {
  State& s = state_;
  ++s.samples;
  follow(input.feed, input.feed_sigma, input.reading_n, noise_n2, s.samples - 1);
  const Fits fits = fit_moments();
  if (!(s.misfit > kBadFit + kBadFitEach * static_cast<float>(s.samples))) {
    conclude(fits);
    return false;
  }
  // No moment explains it: look again from here, and in the end give up the model's past.
  if (++s.restarts > kMostRestarts) {
    conclude(fits);
    s.samples = 0;
    begin(input);
    return false;
  }
  begin_jump(input, noise_n2);
  return true;
}

bool GainTracker::surprises(const Input& input, float innovation,
                            float innovation_n) const noexcept {  // (C79)
  const State& s = state_;
  if (s.ticks < 1) return false;
  const float size = magnitude(innovation);
  const float twice = kTwiceThreshold_ratio * config_.jump_threshold;
  const bool again =
      size > twice && innovation * s.last_innovation > 0.0F && magnitude(s.last_innovation) > twice;
  const bool surprise = size > config_.jump_threshold || again;
  if (s.air == 0) return surprise;
  return !input.air || innovation_n > input.entry_n || (surprise && innovation_n > 0.0F);
}

// What a calm reading tells of trend, noise and the gain to remember.
void GainTracker::note_calm(float innovation, float trend) noexcept {
  State& s = state_;
  const float memory = config_.period_s / (kTrendMemory_s + config_.period_s);
  s.correlation += memory * (innovation * s.last_innovation - s.correlation);
  s.power += memory * (square(innovation) - s.power);
  if (s.air != 0) return;
  if (magnitude(innovation) < kUsual && trend < kTrendFloor) {
    const float slow = config_.period_s / (kNoiseMemory_s + config_.period_s);
    s.noise_scale *= 1.0F + slow * (square(innovation) / kUsualPower - 1.0F);
    s.noise_scale = std::clamp(s.noise_scale, kQuietest, kLoudest);
  }
  if (s.covariance[kKK] < square(kSettled_ratio * s.gain_n)) s.memory_n = s.gain_n;
}

auto GainTracker::step(const Input& input) noexcept -> Output {
  State& s = state_;
  if (s.started == 0) begin(input);
  if (input.air && s.air == 0 && s.samples == 0) settle_in_air();
  const Point before{.force_n = s.force_n,
                     .sensed_n = s.sensed_n,
                     .gain_n = s.gain_n,
                     .feed = input.feed,
                     .feed_sigma = input.feed_sigma,
                     .reading_n = input.reading_n,
                     .variance_n2 = s.covariance[kKK]};
  const float trend = std::clamp(s.correlation / std::max(s.power, 0.5F), 0.0F, 1.0F);
  const float drift =
      (kDrift_ratio_sqrt_s + kTrend_ratio_sqrt_s * std::max(trend - kTrendFloor, 0.0F)) *
      std::sqrt(config_.period_s);
  const float noise_n2 =
      s.noise_scale * (square(config_.noise_ratio * input.reading_n) + square(config_.noise_n));
  bool jumped = false;
  float innovation = 0.0F;
  if (s.samples > 0) {
    jumped = follow_on(input, noise_n2);
  } else {
    predict(input.feed, input.feed_sigma, drift);
    const float innovation_n = input.reading_n - s.sensed_n;
    const float variance_n2 = s.covariance[kSS] + noise_n2;
    innovation = innovation_n / std::sqrt(variance_n2);
    if (surprises(input, innovation, innovation_n)) {
      s.air = 0;
      s.restarts = 0;
      begin_jump(input, noise_n2);
      jumped = true;
    } else {
      correct(innovation_n, variance_n2);
      s.gain_n = std::clamp(s.gain_n, 0.0F, kMostGain_ratio * config_.gain_n);
      note_calm(innovation, trend);
    }
  }
  const bool resolving = s.samples > 0;
  s.last_innovation = resolving ? 0.0F : innovation;
  if (resolving) s.correlation = 0.0F;
  if (s.samples >= kSamples) {
    s.samples = 0;
    s.covariance[kKK] += square(kModelSpread_ratio * s.gain_n);  // (C83)
  }
  s.past = before;
  s.ticks = 1;
  return {.force_n = std::max(s.force_n, 0.0F),
          .gain_n = s.gain_n,
          .gain_sigma_n = std::sqrt(s.covariance[kKK]),
          .trend = trend,
          .innovation = innovation,
          .jumped = jumped,
          .resolving = resolving,
          .rising = s.rising != 0};
}

}  // namespace cutforce::control
