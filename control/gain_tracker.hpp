// Force, estimate and process gain from the readings and the known feed: a Kalman filter while the
// cut changes slowly, and a jump resolver when it does not. Equations (C76)-(C83).
//
//   x = [F, s, K], F- = e_p F + (1 - e_p) K z, s- = e_s s + c_1 F + c_2 K z, K- = K
//
// z is the mean feed over the tick, in the w-domain (force_model.hpp). A reading too far from
// s- means that K has jumped at a moment between two ticks ago and now. Six such moments and
// "nothing happened" are then followed side by side for a few readings, each with the gain that
// fits it best; force and gain are their mean, weighted by how well each fits, and the spread
// of that mean is the uncertainty that the controller is told.
//
// In the air the gain is zero and the last one is remembered: entry is a jump whose size is about
// the remembered gain.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "control/force_model.hpp"

namespace cutforce::control {

namespace detail {
enum Covariance : std::size_t { kFF, kFs, kFK, kSS, kSK, kKK };
}

class GainTracker {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kLags, kGain, kNoise, kThreshold };

  static constexpr std::size_t kMoments = 6;    // of a jump: 2 ticks of 3
  static constexpr std::uint32_t kSamples = 5;  // readings that a jump is followed for

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

  struct Moment {
    float force = 0.0F;  // response of F and s to a unit of gain since the jump
    float sensed = 0.0F;
    float fit = 0.0F;     // sum of h r / R
    float weight = 0.0F;  // sum of h^2 / R
  };

  struct Point {  // of the past, to start again from
    float force_n = 0.0F;
    float sensed_n = 0.0F;
    float gain_n = 0.0F;
    float feed = 0.0F;  // of the tick after it
    float feed_sigma = 0.0F;
    float reading_n = 0.0F;  // at the end of that tick
    float variance_n2 = 1.0F;
  };

  struct State {
    float force_n = 0.0F;
    float sensed_n = 0.0F;
    float gain_n = 0.0F;
    std::array<float, 6> covariance{};  // FF, Fs, FK, ss, sK, KK
    float memory_n = 0.0F;              // last gain that was settled in a cut
    float correlation = 0.0F;
    float power = 1.0F;
    float last_innovation = 0.0F;
    float noise_scale = 1.0F;  // variance of the readings over the configured one
    Point past{};              // before the last reading
    // The jump that is being followed.
    Point base{};  // open loop since the jump may have begun
    std::array<Moment, kMoments> moments{};
    float residual = 0.0F;   // sum of r^2 / R if nothing happened
    float misfit = 0.0F;     // the same of the moment that fits best
    float timing_n2 = 0.0F;  // variance of the reading because the feed's moment is unknown
    float prior_mean_n = 0.0F;
    float prior_variance_n2 = 1.0F;
    std::uint32_t samples = 0;   // 0: no jump
    std::uint32_t restarts = 0;  // of this jump, because no moment fitted
    std::uint32_t ticks = 0;     // 1: past holds the tick before
    std::uint32_t started = 0;
    std::uint32_t rising = 0;
    std::uint32_t air = 1;
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

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr std::array<float, 3> kOnset{0.05F, 0.35F, 0.7F};  // parts of a tick

  explicit constexpr GainTracker(const Config& config) noexcept;

  void predict(float feed, float feed_sigma, float drift) noexcept;
  void correct(float innovation_n, float variance_n2) noexcept;
  [[gnu::cold]] void begin_jump(const Input& input, float noise_n2) noexcept;
  void follow(float feed, float feed_sigma, float reading_n, float noise_n2,
              std::uint32_t tick) noexcept;
  struct Fit {
    float sharpness;  // 1 / variance of the gain
    float jump_n;     // of the gain
    float misfit;     // sum of r^2 / R, with the prior's share
  };
  using Fits = std::array<Fit, kMoments>;
  [[nodiscard]] [[gnu::cold]] Fits fit_moments() noexcept;
  [[gnu::cold]] void conclude(const Fits& fits) noexcept;
  [[nodiscard]] [[gnu::cold]] bool follow_on(const Input& input, float noise_n2) noexcept;
  [[nodiscard]] bool surprises(const Input& input, float innovation,
                               float innovation_n) const noexcept;
  void note_calm(float innovation, float trend) noexcept;
  [[gnu::cold]] void begin(const Input& input) noexcept;
  [[gnu::cold]] constexpr void settle_in_air() noexcept;

  Config config_;
  LagStep lag_;
  std::array<LagStep, 3> partial_;  // from a moment of a jump to the end of its tick
  State state_{};
};

constexpr auto GainTracker::make(const Config& config) noexcept
    -> std::expected<GainTracker, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return GainTracker{config};
}

constexpr GainTracker::GainTracker(const Config& config) noexcept
    : config_(config),
      lag_(LagStep::of(config.period_s, 0.0F, config.cut_lag_s, config.sensor_lag_s)) {
  for (std::size_t k = 0; k < kOnset.size(); ++k) {
    partial_[k] = LagStep::of((1.0F - kOnset[k]) * config.period_s, 0.0F, config.cut_lag_s,
                              config.sensor_lag_s);
  }
  state_.memory_n = config.gain_n;
  settle_in_air();
}

// Out of the cut: the last gain is remembered.
constexpr void GainTracker::settle_in_air() noexcept {
  State& s = state_;
  s.air = 1;
  s.gain_n = 0.0F;
  s.covariance = {};
  s.covariance[detail::kSS] = config_.noise_n * config_.noise_n;
  s.correlation = 0.0F;
  s.power = 1.0F;
}

static_assert(std::is_trivially_copyable_v<GainTracker>);

}  // namespace cutforce::control
