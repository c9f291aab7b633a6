// Force, estimate and process gain while the gain has jumped by nobody knows how much, and nobody
// knows when. Equations (C80)-(C83).
//
// Six moments between two ticks ago and now, and "nothing happened", are followed side by side for
// a few readings, each with the gain that fits it best. Force and gain are their mean, weighted by
// how well each fits, and the spread of that mean is the uncertainty that the controller is told.
//
// Every reading passes over the moments three times: one tick on with its fit; its probability, and
// with it the mean; the spread around the mean. No pass can be spared: a probability is relative to
// the best fit, and a spread summed up around anything but the mean loses in single precision what
// a noise far below the force would leave of it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "control/force_model.hpp"

namespace cutforce::control {

// Mean and covariance of x = [F, s, K].
struct ForceBelief {
  enum Covariance : std::size_t { kFF, kFs, kFK, kSS, kSK, kKK };

  float force_n = 0.0F;
  float sensed_n = 0.0F;
  float gain_n = 0.0F;
  std::array<float, 6> covariance{};
};

class JumpResolver {
 public:
  static constexpr std::size_t kTicks = 2;  // in which it may have begun
  static constexpr std::size_t kMomentsOfTick = 3;
  static constexpr std::size_t kMoments = kTicks * kMomentsOfTick;
  static constexpr std::uint32_t kSamples = 5;  // readings that a jump is followed for

  struct Config {
    float period_s;
    float cut_lag_s;
    float sensor_lag_s;
    float most_gain_n;  // no gain is above it
  };

  struct Reading {
    float reading_n;
    float feed;        // z: mean over the tick that ends with it
    float feed_sigma;  // of z
    float noise_n2;    // variance of the reading
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

  struct Moment {
    float force = 0.0F;  // response of F and s to a unit of gain since the jump
    float sensed = 0.0F;
    // Of the gain that fits best, with the prior's share: its sharpness times it,
    float pull = 0.0F;       // mu / V + sum of h r / R
    float sharpness = 0.0F;  // 1 / V + sum of h^2 / R, 1 / its variance
  };

  struct State {
    Point base{};  // open loop since the jump may have begun
    std::array<Moment, kMoments> moments{};
    float residual = 0.0F;      // sum of r^2 / R if nothing happened
    float timing_n2 = 0.0F;     // variance of the reading because the feed's moment is unknown
    float prior_misfit = 0.0F;  // mu^2 / V
    float prior_variance_n2 = 1.0F;
    std::uint32_t samples = 0;   // 0: no jump
    std::uint32_t restarts = 0;  // of this jump, because no moment fitted
    std::uint32_t rising = 0;
  };

  enum class Outcome : std::uint8_t {
    kFollows,      // one more reading
    kBeginsAgain,  // no moment explains the readings: from the last two
    kGivesUp,      // nor did those that it began again from
  };

  explicit constexpr JumpResolver(const Config& config) noexcept;

  [[nodiscard]] bool active() const noexcept { return state_.samples > 0; }
  [[nodiscard]] bool rising() const noexcept { return state_.rising != 0; }
  // A jump at most two ticks ago, `past` being the state of then. `memory_n` is the gain that is
  // expected out of the air.
  void begin(const Point& past, const Reading& now, float memory_n, ForceBelief& belief) noexcept;
  [[nodiscard]] Outcome follow(const Point& past, const Reading& now, float memory_n,
                               ForceBelief& belief) noexcept;
  // Whether enough readings were followed; if so, no jump is followed any more.
  [[nodiscard]] bool finish() noexcept {
    if (state_.samples < kSamples) return false;
    state_.samples = 0;
    return true;
  }
  void drop() noexcept { state_.samples = 0; }

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr std::array<float, kMomentsOfTick> kOnset{0.05F, 0.35F, 0.7F};  // of a tick

  struct Fit {
    float jump_n;  // of the gain
    float misfit;  // sum of r^2 / R, with the prior's share
    float share;   // probability, not yet of a sum of 1
  };
  struct Fits {
    std::array<Fit, kMoments> of;
    float least;  // misfit of the best, "nothing happened" among them
  };
  struct Residual {   // of a reading from the open loop
    float sharpness;  // 1 / R
    float pull;       // r / R
  };
  struct Onset {  // response to a unit of feed at the end of the tick in which the jump was
    float force;
    float sensed;
  };
  void start(const Point& past, const Reading& now, float memory_n, Fits& fits,
             ForceBelief& belief) noexcept;
  [[nodiscard]] Residual advance_base(const Reading& reading, float gain_n) noexcept;
  static void fit(const Moment& moment, float misfit, Fit& fit, float& least) noexcept;
  void conclude(Fits& fits, ForceBelief& belief) const noexcept;

  LagStep lag_;
  float left_;  // of the cut, (1 - e_p)
  std::array<Onset, kMomentsOfTick> onsets_;
  float most_gain_n_;
  State state_{};
};

constexpr JumpResolver::JumpResolver(const Config& config) noexcept
    : lag_(LagStep::of(config.period_s, 0.0F, config.cut_lag_s, config.sensor_lag_s)),
      left_(1.0F - lag_.cut),
      most_gain_n_(config.most_gain_n) {
  for (std::size_t k = 0; k < kMomentsOfTick; ++k) {
    const auto rest = LagStep::of((1.0F - kOnset[k]) * config.period_s, 0.0F, config.cut_lag_s,
                                  config.sensor_lag_s);
    onsets_[k] = {.force = 1.0F - rest.cut, .sensed = rest.sensed_input};
  }
}

static_assert(std::is_trivially_copyable_v<JumpResolver>);
static_assert(std::is_standard_layout_v<JumpResolver::State>);

}  // namespace cutforce::control
