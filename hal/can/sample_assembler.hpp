// Samples from an acquisition node's frames. Time is the node's: the 8-bit count of samples,
// unwrapped, times the period; when a frame was received only tells how often the count has
// wrapped. So what the loop sees does not depend on when the board was awake.
//
//   advance = the number that fits the count's 8 bits and is nearest to the time that went by
//   time    = (sum of the advances) * period
//
// The time that went by is taken from the smoothed time of receipt, which no single late frame
// moves much. So frames may come up to 100 samples earlier or later than that. A frame whose count
// follows the last one by one may come 200 late or early, which is what the first frames need while
// nothing is smoothed yet. A silence is known to 256 samples, as the two clocks drift against each
// other: by 128 samples in 20 minutes at 1 kHz and 100 ppm.
//
// Time never goes back. When the node starts anew its count jumps to 0: seen over a silence of more
// than 128 samples that is a gap of about the right length; seen at once, either a gap of up to 128
// samples, or up to 128 samples are dropped as late until the count has caught up. Where it happens
// to go on by one within 200 samples, no gap is seen.
//
// A Spindle frame goes with the Phases frame of the same count, which the node sends after it; one
// that comes late goes with the next sample, and one that is older than that with none, nor one
// that waited over a gap of 128 samples. A gap in the count is lost samples: they are counted, and
// the loop's own gate sees the gap in time.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <optional>
#include <type_traits>

#include "hal/can/messages.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::can {

class SampleAssembler {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kFullScale };

  struct Config {
    std::int64_t period_ns;      // of samples
    float voltage_full_scale_v;  // of voltage_ratio 1
    float current_full_scale_a;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_ns > 0 && period_ns <= 1'000'000'000)) {
        return std::unexpected{ConfigError::kPeriod};
      }
      if (!(voltage_full_scale_v > 0.0F && current_full_scale_a > 0.0F)) {
        return std::unexpected{ConfigError::kFullScale};
      }
      return {};
    }
  };

  struct State {
    std::int64_t count = 0;        // of the last sample, unwrapped
    std::int64_t expected_ns = 0;  // receipt of the last sample, smoothed
    std::uint32_t started = 0;
    std::uint32_t lost = 0;             // samples missing in the count, since the start
    std::uint32_t repeated = 0;         // samples that came twice, or late, and were dropped
    std::uint32_t spindle_present = 0;  // 1: a Spindle frame waits for its sample
    std::uint32_t spindle_count = 0;
    std::uint32_t spindle_signals = 0;  // bit(Signal) of each value that it has
    float speed_rad_s = 0.0F;
    float power_meter_w = 0.0F;
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<SampleAssembler, ConfigError> make(
      const Config& config) noexcept;

  // A sample, or nothing where it has come before. `received_ns` does not go back. With a voltage
  // or current that the node marks as not valid, the sample lacks all three of its kind.
  [[nodiscard]] std::optional<Sample> take(const Phases& phases, std::int64_t received_ns) noexcept;
  void take(const Spindle& spindle) noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr std::int64_t kLateCounts = 200;  // of a frame that follows the last by one
  static constexpr std::int64_t kSmoothing = 64;    // frames

  explicit constexpr SampleAssembler(const Config& config) noexcept : config_(config) {}

  [[nodiscard]] std::int64_t advance(std::uint8_t count, std::int64_t received_ns) const noexcept;
  void put_phases(const Phases& phases, Sample& sample) const noexcept;
  void put_spindle(std::uint8_t count, Sample& sample) noexcept;

  Config config_;
  State state_{};
};
constexpr std::expected<SampleAssembler, SampleAssembler::ConfigError> SampleAssembler::make(
    const Config& config) noexcept {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return SampleAssembler{config};
}

static_assert(std::is_trivially_copyable_v<SampleAssembler>);

}  // namespace cutforce::hal::can
