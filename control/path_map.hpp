// What the last part taught: at which feed the force would have been at the reference, along the
// controller's own path. Equations (C92)-(C99).
//
// The path coordinate x is the feed that the override must have made, in seconds at 100 %; it needs
// no position from the CNC, only the moment at which a part, or a repeated block, starts. A
// cell holds e = (K / K_0)^(-1/p), so that e (F_r / (K_0 r))^(1/p) is the override that holds the
// reference there, r being how much more the tool takes now than it did then.
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

namespace cutforce::control {

class PathMap {
 public:
  static constexpr std::size_t kCells = 2048;
  static constexpr float kCell_s = 0.02F;  // at 100 %

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
    std::array<std::uint16_t, kCells> learned{};   // of earlier parts; 0: nothing known
    std::array<std::uint16_t, kCells> recorded{};  // of this part
    float position_s = 0.0F;                       // of the tool, at 100 %
    std::array<float, 2> earlier_s{};              // one and two ticks ago
    float wear_ratio = 1.0F;
    float last_gain_n = 0.0F;     // settled, before a jump
    float doubt_s = 0.0F;         // the map has held the force down for
    float doubt_from_s = 0.0F;    // and since this place
    std::uint32_t resolving = 0;  // a jump is being followed
    std::uint32_t rising = 0;     // which began upwards
    std::uint32_t written = 0;    // cells of this part
    std::uint32_t started = 0;    // 1: a part has begun
    std::uint32_t trusted = 1;
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<PathMap, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return PathMap{config};
  }

  // A part begins: what the last one taught is kept.
  void start() noexcept;
  // Nobody knows where the tool is: nothing is learned or limited until the next part begins.
  void lose_place() noexcept {
    state_.written = 0;
    state_.started = 0;
  }
  // Once a tick, before limit(): a tick without anything to learn, or one with.
  void pass(float feed_ratio) noexcept;
  void learn(const Lesson& lesson) noexcept;
  // The override that the map allows; the wanted one where it has nothing against it.
  [[nodiscard]] float limit(const Question& question) noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  explicit constexpr PathMap(const Config& config) noexcept : config_(config) {}

  [[nodiscard]] std::uint16_t cell_of(float gain_n) const noexcept;
  void write_to(float position_s, float gain_n) noexcept;
  [[nodiscard]] float slowest(const Question& question, float scale_pct) const noexcept;

  Config config_;
  State state_{};
};

static_assert(std::is_trivially_copyable_v<PathMap>);

}  // namespace cutforce::control
