// What the last part taught: at which feed the force would have been at the reference, along the
// controller's own path. Equations (C92)-(C99).
//
// The path coordinate x is the feed that the override must have made, in seconds at 100 %; it needs
// no position from the CNC, only the moment at which a part, or a repeated block, starts. A
// cell holds e = (K / K_0)^(-1/p), so that e (F_r / (K_0 r))^(1/p) is the override that holds the
// reference there, r being how much more the tool takes now than it did then.
//
// A cell that was passed is not asked for again before the next part, so what this part says of it
// is merged in at once, as soon as its neighbours are known: one map instead of two, 4 kB less, and
// no tick in which a whole part is merged, 200 000 instructions on a Cortex-M7.
//
// The map only ever lowers the override: it brakes before a cell that needs less, and says nothing
// where the cut gets lighter. Where it makes the force stay far below the reference it is
// wrong, and is not believed for the rest of the part.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "control/feed_power.hpp"

namespace cutforce::control {

class PathMap {
 public:
  static constexpr std::size_t kCells = 2048;
  static constexpr float kCell_s = 0.02F;  // at 100 %

  static constexpr std::uint16_t kFree = 65535;  // air, or so light a cut that nothing limits

  enum class ConfigError : std::uint8_t { kPeriod, kLags, kExponent, kGain };

  struct Config {
    float period_s;
    float feed_lag_s;
    float sensor_lag_s;
    float feed_exponent;
    float gain_n;  // K_0

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s > 0.0F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(feed_lag_s >= 0.0F && feed_lag_s <= 10.0F && sensor_lag_s >= 0.0F &&
            sensor_lag_s <= 10.0F))
        return std::unexpected{ConfigError::kLags};
      if (!(feed_exponent >= 0.3F && feed_exponent <= 1.5F))
        return std::unexpected{ConfigError::kExponent};
      if (!(gain_n > 0.0F && gain_n <= 1e7F)) return std::unexpected{ConfigError::kGain};
      return {};
    }
  };

  struct Lesson {
    float feed_ratio;  // mean over the tick, of 100 %
    float gain_n;      // 0 in the air
    bool jumped;       // the gain has jumped, a moment ago
    bool rising;       // and upwards
    bool resolving;    // it is not known yet how far
    bool steady;       // the gain can be compared with the map's
  };

  struct Question {
    float reference_n;
    float ahead_s;        // path to the end of the dead time
    float force_n;        // there
    float override_pct;   // wanted without the map
    float spindle_ratio;  // spindle speed over the programmed one
    bool air;
  };

  struct State {
    float position_s = 0.0F;           // of the tool, at 100 %
    std::array<float, 2> earlier_s{};  // one and two ticks ago
    float wear_feed_ratio = 1.0F;      // override that holds the reference now, over that of then
    std::uint32_t last_cell = 0;       // of the gain that was settled, before a jump
    float doubt_s = 0.0F;              // the map has held the force down for
    float doubt_from_s = 0.0F;         // and since this place
    std::uint32_t resolving = 0;       // a jump is being followed
    std::uint32_t rising = 0;          // which began upwards
    std::uint32_t written = 0;         // cells of this part
    std::uint32_t started = 0;         // 1: a part has begun
    std::uint32_t trusted = 1;
    std::array<std::uint16_t, 5> recorded{};  // the last cells of this part, the latest last
    std::uint16_t reserved = 0;
    // Of earlier parts, and of this one up to two cells behind the last that was written; 0:
    // nothing known. The last of all, where a Cortex-M7 does not have to reach over it.
    std::array<std::uint16_t, kCells> learned{};
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<PathMap, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return PathMap{config};
  }
  // Of a config that check() accepts, made where it stays.
  [[nodiscard]] static constexpr PathMap make_checked(const Config& config) noexcept {
    return PathMap{config};
  }

  // A part begins: what the last one taught is kept.
  [[gnu::cold]] void start() noexcept;
  // Nobody knows where the tool is: nothing is learned or limited until the next part begins.
  void lose_place() noexcept {
    state_.written = 0;
    state_.started = 0;
  }
  // Once a tick, before limit(): a tick without anything to learn, or one with.
  void pass(float feed_ratio) noexcept {  // (C92)
    State& s = state_;
    s.earlier_s = {s.position_s, s.earlier_s[0]};
    s.position_s += feed_ratio * config_.period_s;
  }
  void learn(const Lesson& lesson) noexcept;
  // The override that the map allows; the wanted one where it has nothing against it.
  [[nodiscard]] float limit(const Question& question) noexcept;

  // Whether learn() does more than pass().
  [[nodiscard]] bool records() const noexcept { return state_.started != 0; }
  // Whether limit() may have something against an override.
  [[nodiscard]] bool limits() const noexcept { return state_.started != 0 && state_.trusted != 0; }

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kWearLeast = 0.7F;
  static constexpr float kWearMost = 1.5F;
  static constexpr float kFar_ratio = 1.3F;  // a gain this far off the map's tells nothing of wear

  explicit constexpr PathMap(const Config& config) noexcept;

  [[nodiscard]] float feed_at_reference(float gain_n) const noexcept;
  void write_to(float position_s, std::uint16_t cell) noexcept;
  [[gnu::cold]] void believe(std::uint32_t cell, std::uint32_t count) noexcept;
  void merge(std::uint32_t cell, std::uint32_t sum, std::uint32_t count) noexcept;
  void follow_wear(float feed_now, float feed_then) noexcept;
  [[nodiscard]] float slowest(const Question& question, float scale_pct) const noexcept;

  Config config_;
  float inverse_exponent_;  // 1/p
  float wear_far_ratio_;    // bounds of the wear, in the domain of the feed
  float wear_least_ratio_;
  float wear_most_ratio_;
  // The last reference and the override that holds it at K_0: it hardly ever changes.
  float reference_n_ = 0.0F;
  float reference_feed_ = 0.0F;
  State state_{};
};

constexpr PathMap::PathMap(const Config& config) noexcept
    : config_(config),
      inverse_exponent_(1.0F / config.feed_exponent),
      wear_far_ratio_(feed_power(kFar_ratio, inverse_exponent_)),
      wear_least_ratio_(feed_power(kWearMost, -inverse_exponent_)),
      wear_most_ratio_(feed_power(kWearLeast, -inverse_exponent_)) {
  state_.last_cell = kFree;
}

static_assert(std::is_trivially_copyable_v<PathMap>);

}  // namespace cutforce::control
