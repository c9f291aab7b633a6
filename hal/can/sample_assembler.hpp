// Samples from an acquisition node's frames. Time is the node's: the 8-bit count of samples,
// unwrapped, times the period; when a frame was received only tells how often the count has
// wrapped. So what the loop sees does not depend on when the board was awake.
//
// A Spindle frame goes with the Phases frame of the same count, which the node sends after it; one
// that comes late goes with the next sample, and one that is older than that with none. A gap in
// the count is lost samples: they are counted, and the loop's own gate sees the gap in time.
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
    std::int64_t received_ns = 0;  // of the last sample
    std::uint32_t started = 0;
    std::uint32_t lost = 0;      // samples missing in the count, since the start
    std::uint32_t repeated = 0;  // samples that came twice, or late, and were dropped
    std::uint32_t spindle_count = 0;
    std::uint32_t spindle_present = 0;
    float speed_rad_s = 0.0F;
    float power_meter_w = 0.0F;
    std::uint32_t speed_present = 0;
    std::uint32_t meter_present = 0;
  };

  // Fails iff check() does.
  [[nodiscard]] static std::expected<SampleAssembler, ConfigError> make(
      const Config& config) noexcept;

  // A sample, or nothing where it has come before. `received_ns` does not go back. With a voltage
  // or current that the node marks as not valid, the sample lacks all three of its kind.
  [[nodiscard]] std::optional<Sample> take(const Phases& phases, std::int64_t received_ns) noexcept;
  void take(const Spindle& spindle) noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  explicit SampleAssembler(const Config& config) noexcept : config_(config) {}

  Config config_;
  State state_{};
};
static_assert(std::is_trivially_copyable_v<SampleAssembler>);

}  // namespace cutforce::hal::can
