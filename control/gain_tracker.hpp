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
// step() is defined in gain_tracker_tick.hpp, for who calls it.
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
  [[nodiscard]] static constexpr std::expected<GainTracker, ConfigError> make(
      const Config& config) noexcept;
  // Of a config that check() accepts, made where it stays.
  [[nodiscard]] static constexpr GainTracker make_checked(const Config& config) noexcept {
    return GainTracker{config};
  }

  [[nodiscard]] Output step(const Input& input) noexcept;
  // The feed goes on, the reading is not to be learned from.
  void coast(float feed) noexcept;

  // Another part: only the last gain is remembered.
  [[gnu::cold]] void restart() noexcept;

  [[nodiscard]] bool follows_jump() const noexcept { return jump_.active(); }
  [[nodiscard]] float gain_n() const noexcept { return own_.now.gain_n; }
  [[nodiscard]] State state() const noexcept { return {.own = own_, .jump = jump_.state()}; }
  void restore(const State& state) noexcept {
    own_ = state.own;
    jump_.restore(state.jump);
  }

 private:
  static constexpr float kTrendMemory_s = 0.25F;
  static constexpr float kNoiseMemory_s = 20.0F;
  static constexpr float kUsualPower =
      0.9F;  // of a normal variable cut off at kUsual, less a margin
  static constexpr float kTwiceThreshold_ratio = 0.81F;
  static constexpr float kMostGain_ratio = 1000.0F;  // of the config's: no cut

  static constexpr float kDrift_ratio_sqrt_s = 0.018F;  // of the gain, in a steady cut
  static constexpr float kTrend_ratio_sqrt_s = 0.168F;  // more of it for each unit of trend
  static constexpr float kTrendFloor = 0.1F;
  static constexpr float kSettled_ratio = 0.1F;  // spread of a gain that is remembered
  // The noise is matched to what is seen in a calm cut: a variance over the configured one.
  static constexpr float kUsual = 3.0F;     // standard deviations; more is no noise
  static constexpr float kQuietest = 1.0F;  // what the config says, at least
  static constexpr float kLoudest = 10.0F;

  static constexpr float square(float x) noexcept { return x * x; }
  // std::clamp(x, 0, most), told by one comparison of whole numbers where there is nothing to do.
  static constexpr float up_to(float x, float most) noexcept {
    return std::bit_cast<std::uint32_t>(x) <= std::bit_cast<std::uint32_t>(most)
               ? x
               : std::clamp(x, 0.0F, most);
  }

  explicit constexpr GainTracker(const Config& config) noexcept;

  void predict(ForceBelief& x, float feed, float feed_sigma, float drift) const noexcept;
  static void correct(ForceBelief& x, float innovation_n, float variance_n2) noexcept;
  [[nodiscard]] static bool sound(const ForceBelief& x) noexcept;
  void make_sound() noexcept;
  [[nodiscard]] float trend() const noexcept;
  [[nodiscard]] bool surprises(const Input& input, float innovation,
                               float innovation_n) const noexcept;
  void note_calm(float innovation, bool drifts) noexcept;
  void remember(const JumpResolver::Reading& reading) noexcept;
  [[gnu::cold]] void begin_jump(const JumpResolver::Reading& reading) noexcept;
  [[nodiscard]] JumpResolver::Outcome follow_on(const JumpResolver::Reading& reading) noexcept;
  [[gnu::cold]] void begin(float reading_n, float feed, float entry_n) noexcept;
  [[gnu::cold]] constexpr void settle_in_air() noexcept;

  LagStep lag_;
  float left_;  // of the cut, (1 - e_p)
  float noise_ratio_;
  float noise_n2_;
  float jump_threshold_;
  float twice_threshold_;  // two readings in a row need no more
  float most_gain_n_;
  float sqrt_period_;
  float memory_share_;  // of a tick in the trend
  float noise_kept_;    // factor of the noise that a tick without any leaves,
  float noise_share_;   // and what one of a standard deviation adds
  Own own_{};
  JumpResolver jump_;
};

constexpr auto GainTracker::make(const Config& config) noexcept
    -> std::expected<GainTracker, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return GainTracker{config};
}

constexpr GainTracker::GainTracker(const Config& config) noexcept
    : lag_(LagStep::of(config.period_s, 0.0F, config.cut_lag_s, config.sensor_lag_s)),
      left_(1.0F - lag_.cut),
      noise_ratio_(config.noise_ratio),
      noise_n2_(square(config.noise_n)),
      jump_threshold_(config.jump_threshold),
      twice_threshold_(kTwiceThreshold_ratio * config.jump_threshold),
      most_gain_n_(kMostGain_ratio * config.gain_n),
      sqrt_period_(std::sqrt(config.period_s)),
      memory_share_(config.period_s / (kTrendMemory_s + config.period_s)),
      noise_kept_(kNoiseMemory_s / (kNoiseMemory_s + config.period_s)),
      noise_share_(config.period_s / (kNoiseMemory_s + config.period_s) / kUsualPower),
      jump_({.period_s = config.period_s,
             .cut_lag_s = config.cut_lag_s,
             .sensor_lag_s = config.sensor_lag_s,
             .most_gain_n = most_gain_n_}) {
  own_.memory_n = config.gain_n;
  settle_in_air();
}

// Out of the cut: the last gain is remembered.
constexpr void GainTracker::settle_in_air() noexcept {
  Own& s = own_;
  s.air = 1;
  s.now.gain_n = 0.0F;
  s.now.covariance = {};
  s.now.covariance[ForceBelief::kSS] = noise_n2_;
  s.correlation = 0.0F;
  s.power = 1.0F;
}

static_assert(std::is_trivially_copyable_v<GainTracker>);
static_assert(std::is_standard_layout_v<GainTracker::State>);

}  // namespace cutforce::control
