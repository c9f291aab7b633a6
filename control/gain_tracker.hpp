// Force, estimate and process gain from the readings and the known feed: a Kalman filter while the
// cut changes slowly, and a jump resolver when it does not. Equations (C76)-(C79).
//
//   x = [F, s, K], F- = e_p F + (1 - e_p) K z, s- = e_s s + c_1 F + c_2 K z, K- = K
//
// z is the mean feed over the tick, in the w-domain (force_model.hpp). A reading too far from
// s- means that K has jumped at a moment between two ticks ago and now; jump_resolver.hpp follows
// it for a few readings.
//
// In the air the gain is zero and the last one is remembered: entry is a jump whose size is about
// the remembered gain.
//
// The tick of a calm cut stands here, so that it becomes one with the law's (predictive.cpp), its
// nine numbers in registers from the prediction to the correction; what is rare is in the source.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "control/force_model.hpp"
#include "control/jump_resolver.hpp"

namespace cutforce::control {

class GainTracker {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kLags, kGain, kNoise, kThreshold };

  struct Config {
    float period_s;
    float cut_lag_s;
    float sensor_lag_s;
    float gain_n;          // K before anything is known
    float noise_ratio;     // standard deviation of a reading, of the force
    float noise_n;         // beside it
    float jump_threshold;  // in standard deviations; 4.2: less than one false jump in ten minutes

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s > 0.0F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(cut_lag_s > 0.0F && cut_lag_s <= 100.0F && sensor_lag_s >= 0.0F &&
            sensor_lag_s <= 100.0F && apart(cut_lag_s, sensor_lag_s)))
        return std::unexpected{ConfigError::kLags};
      if (!(gain_n > 0.0F && gain_n <= 1e7F)) return std::unexpected{ConfigError::kGain};
      if (!(noise_ratio >= 0.0F && noise_ratio < 1.0F && noise_n > 0.0F && noise_n <= 1e6F))
        return std::unexpected{ConfigError::kNoise};
      if (!(jump_threshold >= 2.0F && jump_threshold <= 20.0F))
        return std::unexpected{ConfigError::kThreshold};
      return {};
    }
  };

  struct Input {
    float reading_n;
    float feed;        // z: mean over the tick that ends now
    float feed_sigma;  // of z, because nobody knows when exactly the CNC reads the override
    float entry_n;     // in the air a reading this far above the expected one is an entry
    bool air;
  };

  struct Output {
    float force_n;
    float gain_n;
    float gain_sigma_n;
    float trend;       // correlation of successive innovations, 0..1: the gain drifts
    float innovation;  // in standard deviations; 0 while a jump is being followed
    bool jumped;       // with this reading
    bool resolving;    // a jump is being followed
    bool rising;       // the jump is upwards
  };

  struct Own {
    ForceBelief now{};
    float memory_n = 0.0F;  // last gain that was settled in a cut
    float correlation = 0.0F;
    float power = 1.0F;
    float last_innovation = 0.0F;
    float noise_scale = 1.0F;    // variance of the readings over the configured one
    JumpResolver::Point past{};  // before the last reading
    std::uint32_t ticks = 0;     // 1: past holds the tick before
    std::uint32_t started = 0;
    std::uint32_t air = 1;
  };

  struct State {
    Own own{};
    JumpResolver::State jump{};
  };

  // Fails iff check() does.
  [[nodiscard]] static std::expected<GainTracker, ConfigError> make(const Config& config) noexcept;
  // Of a config that check() accepts, made where it stays.
  [[nodiscard]] static GainTracker make_checked(const Config& config) noexcept {
    return GainTracker{config};
  }

  [[nodiscard]] Output step(const Input& input) noexcept;
  // The feed goes on, the reading is not to be learned from.
  void coast(float feed) noexcept;

  // Another part: only the last gain is remembered.
  void restart() noexcept;

  [[nodiscard]] float gain_n() const noexcept { return own_.now.gain_n; }
  [[nodiscard]] State state() const noexcept { return {.own = own_, .jump = jump_.state()}; }
  void restore(const State& state) noexcept {
    own_ = state.own;
    jump_.restore(state.jump);
  }

 private:
  static constexpr float kDrift_ratio_sqrt_s = 0.018F;  // of the gain, in a steady cut
  static constexpr float kTrend_ratio_sqrt_s = 0.168F;  // more of it for each unit of trend
  static constexpr float kTrendFloor = 0.1F;
  static constexpr float kSettled_ratio = 0.1F;  // spread of a gain that is remembered
  // The noise is matched to what is seen in a calm cut: a variance over the configured one.
  static constexpr float kUsual = 3.0F;       // standard deviations; more is no noise
  static constexpr float kUsualPower = 0.9F;  // of a normal variable cut off there, less a margin
  static constexpr float kQuietest = 1.0F;    // what the config says, at least
  static constexpr float kLoudest = 10.0F;

  static constexpr float square(float x) noexcept { return x * x; }

  explicit GainTracker(const Config& config) noexcept;

  void predict(ForceBelief& x, float feed, float feed_sigma, float drift) const noexcept;
  static void correct(ForceBelief& x, float innovation_n, float variance_n2) noexcept;
  static void keep_sound(ForceBelief& x) noexcept;
  static void make_sound(ForceBelief& x) noexcept;
  [[nodiscard]] float trend() const noexcept;
  [[nodiscard]] bool surprises(const Input& input, float innovation,
                               float innovation_n) const noexcept;
  void note_calm(float innovation, bool drifts) noexcept;
  void remember(const Input& input) noexcept;
  void begin_jump(const Input& input, float noise_n2) noexcept;
  [[nodiscard]] JumpResolver::Outcome follow_on(const Input& input, float noise_n2) noexcept;
  void begin(const Input& input) noexcept;
  void settle_in_air() noexcept;

  LagStep lag_;
  float left_;  // of the cut, (1 - e_p)
  float noise_ratio_;
  float noise_n2_;
  float jump_threshold_;
  float twice_threshold_;  // two readings in a row need no more
  float most_gain_n_;
  float sqrt_period_;
  float memory_share_;        // of a tick in the trend,
  float noise_memory_share_;  // and in the noise
  Own own_{};
  JumpResolver jump_;
};

static_assert(std::is_trivially_copyable_v<GainTracker>);
static_assert(std::is_standard_layout_v<GainTracker::State>);

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

// Nearly always there is nothing to do, which products tell without roots: no sign bit among the
// variances, and no square of a covariance near their product. 25 instructions for 75 on a
// Cortex-M7.
inline void GainTracker::keep_sound(ForceBelief& x) noexcept {
  using enum ForceBelief::Covariance;
  constexpr float kNear = 1.0F - 1e-6F;  // more than what the roots are rounded by
  const auto& c = x.covariance;
  const auto bits = [&c](std::size_t k) { return std::bit_cast<std::uint32_t>(c[k]); };
  const float f = kNear * c[kFF];
  const float s = kNear * c[kSS];
  const bool sound = (bits(kFF) | bits(kSS) | bits(kKK)) >> 31U == 0 &&
                     square(c[kFs]) <= f * c[kSS] && square(c[kFK]) <= f * c[kKK] &&
                     square(c[kSK]) <= s * c[kKK];
  if (!sound) [[unlikely]] {
    make_sound(x);
  }
}

inline float GainTracker::trend() const noexcept {
  return std::clamp(own_.correlation / std::max(own_.power, 0.5F), 0.0F, 1.0F);
}

inline bool GainTracker::surprises(const Input& input, float innovation,
                                   float innovation_n) const noexcept {  // (C79)
  const Own& s = own_;
  if (s.ticks == 0) return false;
  const float size = estimator::magnitude(innovation);
  const bool again = innovation * s.last_innovation > 0.0F &&
                     estimator::magnitude(s.last_innovation) > twice_threshold_;
  const bool surprise = size > twice_threshold_ && (size > jump_threshold_ || again);
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
    const float scale = s.noise_scale * (1.0F + noise_memory_share_ * (power / kUsualPower - 1.0F));
    s.noise_scale = std::clamp(scale, kQuietest, kLoudest);
  }
  if (s.now.covariance[ForceBelief::kKK] < square(kSettled_ratio * s.now.gain_n))
    s.memory_n = s.now.gain_n;
}

// To start again from, should the next reading surprise.
inline void GainTracker::remember(const Input& input) noexcept {
  Own& s = own_;
  s.past = {.force_n = s.now.force_n,
            .sensed_n = s.now.sensed_n,
            .gain_n = s.now.gain_n,
            .feed = input.feed,
            .feed_sigma = input.feed_sigma,
            .reading_n = input.reading_n,
            .variance_n2 = s.now.covariance[ForceBelief::kKK]};
  s.ticks = 1;
}

inline auto GainTracker::step(const Input& input) noexcept -> Output {
  Own& s = own_;
  if (s.started == 0) [[unlikely]] {
    begin(input);
  }
  const bool follows = jump_.active();
  if (input.air && s.air == 0 && !follows) settle_in_air();
  const float trend = this->trend();
  const bool drifts = trend > kTrendFloor;
  const float noise_n2 = s.noise_scale * (square(noise_ratio_ * input.reading_n) + noise_n2_);
  bool jumped = false;
  bool resolving = follows;
  float innovation = 0.0F;
  if (follows) [[unlikely]] {
    const auto outcome = follow_on(input, noise_n2);
    jumped = outcome == JumpResolver::Outcome::kBeginsAgain;
    resolving = outcome != JumpResolver::Outcome::kGivesUp;
  } else {
    const float more = drifts ? kTrend_ratio_sqrt_s * (trend - kTrendFloor) : 0.0F;
    ForceBelief x = s.now;
    predict(x, input.feed, input.feed_sigma, (kDrift_ratio_sqrt_s + more) * sqrt_period_);
    keep_sound(x);
    const float innovation_n = input.reading_n - x.sensed_n;
    const float variance_n2 = x.covariance[ForceBelief::kSS] + noise_n2;
    innovation = innovation_n / std::sqrt(variance_n2);
    if (surprises(input, innovation, innovation_n)) [[unlikely]] {
      begin_jump(input, noise_n2);
      jumped = resolving = true;
    } else {
      correct(x, innovation_n, variance_n2);
      x.gain_n = std::clamp(x.gain_n, 0.0F, most_gain_n_);
      keep_sound(x);
      remember(input);
      s.now = x;
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
