#include "hal/can/sample_assembler.hpp"

namespace cutforce::hal::can {
namespace {

constexpr unsigned kCountBits = 8;
constexpr std::int64_t kCounts = std::int64_t{1} << kCountBits;

// Rounded down, by less than 2^31. Bit by bit: it is not often asked for, and a library's division
// of 64 bits is 0.9 kB of flash where the processor has none.
std::int64_t divided_down(std::int64_t value, std::uint32_t by) noexcept {
  const auto inverted = static_cast<std::uint64_t>(value < 0 ? -1 : 0);  // ~(~value / by)
  std::uint64_t bits = static_cast<std::uint64_t>(value) ^ inverted;
  std::uint32_t rest = 0;
  for (int k = 0; k < 64; ++k) {
    rest = rest << 1U | static_cast<std::uint32_t>(bits >> 63U);
    bits <<= 1U;
    if (rest >= by) {
      rest -= by;
      ++bits;
    }
  }
  return static_cast<std::int64_t>(bits ^ inverted);
}

}  // namespace

// By how many samples the count went on: of the numbers that fit its 8 bits, the one nearest to
// the time that went by. But a frame that follows the last one by one is taken at its word while
// that is at all possible: frames come late in crowds more often than 256 of them are lost.
std::int64_t SampleAssembler::advance(std::uint8_t count, std::int64_t received_ns) const noexcept {
  const std::int64_t elapsed_ns = received_ns - state_.expected_ns;
  const auto step = static_cast<std::uint8_t>(count - static_cast<std::uint8_t>(state_.count));
  if (step == 1 && elapsed_ns <= (1 + kLateCounts) * config_.period_ns &&
      elapsed_ns >= (1 - kLateCounts) * config_.period_ns) {
    return 1;
  }
  // Nearest sample: half a period more, rounded down.
  const std::int64_t passed = divided_down(elapsed_ns + config_.period_ns / 2,
                                           static_cast<std::uint32_t>(config_.period_ns));
  const std::int64_t wraps = (passed - step + kCounts / 2) >> kCountBits;
  return step + wraps * kCounts;
}

std::optional<Sample> SampleAssembler::take(const Phases& phases,
                                            std::int64_t received_ns) noexcept {
  if (state_.started == 0) {
    state_.started = 1;
    state_.count = phases.count;
    state_.expected_ns = received_ns;
  } else {
    const std::int64_t went_on = advance(phases.count, received_ns);
    if (went_on <= 0) {
      ++state_.repeated;
      return std::nullopt;
    }
    const std::int64_t expected_ns = state_.expected_ns + went_on * config_.period_ns;
    state_.count += went_on;
    state_.expected_ns = expected_ns + (received_ns - expected_ns) / kSmoothing;
    state_.lost += static_cast<std::uint32_t>(went_on - 1);
    // Whether what waits is of before so long a gap or of behind it, 8 bits cannot say.
    if (went_on >= kCounts / 2) state_.spindle_present = 0;
  }
  Sample sample{};
  sample.time_ns = state_.count * config_.period_ns;
  put_phases(phases, sample);
  put_spindle(phases.count, sample);
  return sample;
}

void SampleAssembler::take(const Spindle& spindle) noexcept {
  state_.spindle_present = 1;
  state_.spindle_count = spindle.count;
  state_.spindle_signals = (spindle.speed_rad_s ? bit(Signal::kSpeed) : 0U) |
                           (spindle.power_meter_w ? bit(Signal::kPowerMeter) : 0U);
  state_.speed_rad_s = spindle.speed_rad_s.value_or(0.0F);
  state_.power_meter_w = spindle.power_meter_w.value_or(0.0F);
}

void SampleAssembler::put_phases(const Phases& phases, Sample& sample) const noexcept {
  const auto put = [&](const std::array<std::optional<float>, 2>& ratio, float full_scale,
                       std::array<float, 3>& values, Signal first) {
    if (!ratio[0] || !ratio[1]) return;
    const float u = *ratio[0] * full_scale;
    const float v = *ratio[1] * full_scale;
    values = {u, v, -(u + v)};
    sample.present |= std::uint32_t{7} << static_cast<unsigned>(first);
  };
  put(phases.voltage_ratio, config_.voltage_full_scale_v, sample.voltage_v, Signal::kVoltageU);
  put(phases.current_ratio, config_.current_full_scale_a, sample.current_a, Signal::kCurrentU);
}

void SampleAssembler::put_spindle(std::uint8_t count, Sample& sample) noexcept {
  if (state_.spindle_present == 0) return;
  const auto age = static_cast<std::uint8_t>(count - state_.spindle_count);
  if (age >= kCounts / 2) return;  // of a sample that is still to come
  state_.spindle_present = 0;
  if (age > 1) return;
  sample.speed_rad_s = state_.speed_rad_s;
  sample.power_meter_w = state_.power_meter_w;
  sample.present |= state_.spindle_signals;
}

}  // namespace cutforce::hal::can
