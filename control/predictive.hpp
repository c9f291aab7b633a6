// The predictive law: the default. From the override that was really sent it knows what the force
// must be; what differs is the process gain. It predicts the force over the dead time with a
// pessimistic gain and sets the override that brings it to the reference within a horizon. It
// retreats within one tick and recovers slowly. Equations (C70)-(C75), (C84)-(C91), (C104), (C105).
//
//   known input -> GainTracker -> pessimistic gain -> prediction over the dead time -> one step
//   of model predictive control in closed form -> a code that the CNC has -> guards
//
// The loop does not depend on the process gain: control and tracking are in the logarithm of it.
// What can destabilise it is time: a true dead time longer than the assumed one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "control/force_model.hpp"
#include "control/gain_tracker.hpp"
#include "control/latency_bank.hpp"
#include "control/law.hpp"
#include "control/path_map.hpp"

namespace cutforce::control {

class Predictive {
 public:
  static constexpr bool kForesees = true;
  static constexpr std::uint32_t kHistory = 24;  // ticks of dead time at the most

  enum class ConfigError : std::uint8_t {
    kPeriod,
    kLatency,
    kLags,
    kExponent,
    kGain,
    kNoise,
    kThreshold,
    kHorizon,
    kRecovery,
    kCaution,
    kRange,
  };

  struct Config {
    float period_s;
    float latency_s;        // from a byte on the port to a feed reference that moves
    float latency_sigma_s;  // of that: a PLC's scan over sqrt(12)
    float feed_lag_s;       // of the feed servo
    float process_lag_s;    // of the cut, one to one and a half turns of the spindle
    float sensor_lag_s;     // of the force estimate
    float feed_exponent;    // of force over feed: 0.75..1
    float process_gain_n;   // force at 100 %, before anything is known
    float noise_ratio;      // of the estimate, of the force
    float noise_n;          // of the estimate, beside it
    float jump_threshold;   // in standard deviations; 4.2
    float calm_horizon_s;   // settling time over 1.5; at least two periods
    float recovery_1_s;     // rate at which a feared gain is forgotten
    float caution_ratio;    // how much of the gain's spread is feared
    float floor_pct;
    float ceiling_pct;
    std::uint32_t step_pct;  // 1 or 10
    bool learns;             // from one part to the next; needs the start of each
    bool finds_latency;      // while cutting: a commissioning step

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept;
  };

  using Input = LawInput;
  using Output = LawOutput;

  // What the law itself keeps, beside its parts.
  struct Own {
    FeedState feed{};
    // (u/u0)^p of the last ticks, newest first from `newest` on. Each is written twice, kHistory
    // apart, so that they lie in a row wherever the row begins and nothing has to be moved.
    std::array<float, 2 * kHistory> sent{};
    std::uint32_t newest = 0;
    float sent_pct = 100.0F;  // u of the newest
    float feared_n = 0.0F;    // pessimistic gain K_c
    float since_jump_s = 100.0F;
    float recovering_s = 100.0F;  // since the override may rise again
    float before_jump_n = 0.0F;   // gain before a jump down, while the cut may be lost; else 0
    float suspected_s = 0.0F;     // the cut may have been lost for
    float timing_doubt = 1.0F;    // times the spread of the dead time
    std::uint32_t last_rising = 0;
    float held_s = 0.0F;     // the present code has been sent for
    float trend_1_s = 0.0F;  // relative slope of the gain
    float last_gain_n = 0.0F;
  };

  struct State {
    GainTracker::State tracker{};
    PathMap::State map{};
    LatencyBank::State bank{};
    Own own{};
  };

  // Fails iff check() does.
  [[nodiscard]] static std::expected<Predictive, ConfigError> make(const Config& config) noexcept;
  // Of a config that make() accepts, made where it stays: 5 kB do not pass over a stack.
  [[nodiscard]] static constexpr Predictive make_checked(const Config& config) noexcept {
    return Predictive{config};
  }

  [[nodiscard]] Output step(const Input& input) noexcept;
  // In charge again after another law: what was learned of parts and of the dead time stays, but
  // nothing of this part, whose path nobody followed.
  [[gnu::cold]] void rejoin() noexcept;

  // Whether a jump of the process gain is being followed: the dearest ticks.
  [[nodiscard]] bool follows_jump() const noexcept { return tracker_.follows_jump(); }

  [[nodiscard]] State state() const noexcept;
  void restore(const State& state) noexcept;

 private:
  explicit constexpr Predictive(const Config& config) noexcept;

  struct Forecast {  // of the end of the dead time
    float force_n;
    float feed;    // v
    float path_s;  // until then, in seconds at 100 %; 0 where nobody asks
  };
  struct Horizon {  // of the force, (C88)
    float force;    // e_H
    float feed;     // g_H
    float command;  // 1 - e_H - g_H
    // How many times the gain that the law works with the true one may be. (C104)
    float stable_gain_ratio;
  };
  enum Reach : std::size_t { kOneTick, kTwoTicks, kMiddle, kCalm, kReaches };

  struct KnownFeed {
    float mean;  // over the tick that ends
    float sigma;
  };
  [[gnu::cold]] constexpr void assume_latency(float latency_s) noexcept;
  [[gnu::cold]] void begin_part() noexcept;
  [[nodiscard]] Output hold(const KnownFeed& feed, float speed, float applied_pct) noexcept;
  [[nodiscard]] KnownFeed known_feed(float applied_pct) noexcept;
  void note_jump(bool rising, float gain_before_n) noexcept;
  void find_latency(const Input& input, bool jumped) noexcept;
  void learn(const GainTracker::Output& seen, float feed, bool settled) noexcept;
  [[nodiscard]] float within_map(float wanted_pct, const Forecast& ahead,
                                 const Input& input) noexcept;
  [[nodiscard]] float feed_ratio(float w) noexcept;
  [[nodiscard]] const float* sent() const noexcept { return &own_.sent[own_.newest]; }

  // predictive_plan.hpp
  [[nodiscard]] float pessimistic_gain_n(const GainTracker::Output& seen,
                                         float spread_ratio) noexcept;
  [[nodiscard]] bool may_rise(const GainTracker::Output& seen, CutPhase phase) noexcept;
  void fear(const GainTracker::Output& seen, float gain_n, bool rise, CutPhase phase) noexcept;
  [[nodiscard]] Forecast forecast(float force_n, float drive_n) noexcept;
  [[nodiscard]] const Horizon& horizon(const GainTracker::Output& seen, float force_n,
                                       float reference_n, bool settled) const noexcept;
  [[nodiscard]] float wanted_pct(const Forecast& ahead, const Horizon& horizon, float drive_n,
                                 float reference_n, bool settled) const noexcept;
  [[nodiscard]] float as_code(float wanted_pct, float sent_pct) const noexcept;

  // In the order of what is asked for most: a Cortex-M7 reaches a float within 1 kB of a pointer.
  Config config_;
  std::uint32_t whole_ticks_;       // of the dead time
  LagStep tick_, early_, late_;     // early_: the part of a tick before a byte arrives
  float early_share_, late_share_;  // of the tick
  float latency_sigma_ratio_;       // of the tick
  std::array<Horizon, kReaches> horizons_;
  float ahead_s_;                   // that the trend of the gain is feared for
  float inverse_exponent_;          // 1/p
  float step_pct_;                  // of the override
  float forgets_ratio_;             // what is left of a feared gain after a tick,
  float forgets_after_jump_ratio_;  // and soon after a jump
  float doubt_share_;               // of a tick in the doubt of the timing,
  float trend_share_;               // and in the trend of the gain
  // The last answer of feed_ratio(): at a resting override w comes to rest too.
  float asked_w_ = 1.0F;
  float answered_ratio_ = 1.0F;
  Own own_{};
  GainTracker tracker_;
  LatencyBank bank_;
  PathMap map_;
};

}  // namespace cutforce::control

#include "control/predictive_make.hpp"  // IWYU pragma: export
