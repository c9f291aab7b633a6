// Rows of converter counts as samples in SI units: hal::SampleSource over a double buffer.
//
//   value = gain * (count - zero), each channel; time = first_ns + row * period_ns
//
// The converter is triggered by a timer, so the number of the row is its time. Rows that were lost
// leave a gap in it, which the loop's sample gate sees.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>

#include "hal/cortex_m/double_buffer.hpp"
#include "hal/port.hpp"
#include "hal/sample_source.hpp"

namespace cutforce::hal::cortex_m {

inline constexpr std::size_t kAdcChannels = 8;

// In the order of Signal: voltages u v w, currents u v w, speed, power meter.
struct AdcRow {
  std::array<std::uint16_t, kAdcChannels> counts;
};

struct AdcScale {
  std::array<float, kAdcChannels> gain;  // V, A, rad/s, W a count; 0: there is no such channel
  std::array<float, kAdcChannels> zero;  // counts
  std::int64_t first_ns;
  std::int64_t period_ns;
};

// One row. Signals without a channel are absent.
[[nodiscard]] constexpr Sample to_sample(const AdcScale& scale, const AdcRow& row,
                                         std::uint64_t number) noexcept {
  std::array<float, kAdcChannels> values{};
  std::uint32_t present = 0;
  for (std::size_t k = 0; k < kAdcChannels; ++k) {
    if (!(scale.gain[k] < 0.0F || scale.gain[k] > 0.0F)) continue;
    values[k] = scale.gain[k] * (static_cast<float>(row.counts[k]) - scale.zero[k]);
    present |= std::uint32_t{1} << k;
  }
  Sample sample{};
  sample.time_ns = scale.first_ns + static_cast<std::int64_t>(number) * scale.period_ns;
  sample.voltage_v = {values[0], values[1], values[2]};
  sample.current_a = {values[3], values[4], values[5]};
  sample.speed_rad_s = values[6];
  sample.power_meter_w = values[7];
  sample.present = present;
  return sample;
}

template <std::size_t kRows>
class AdcSource {
 public:
  constexpr AdcSource(DoubleBuffer<AdcRow, kRows>& buffer, const AdcScale& scale) noexcept
      : buffer_(buffer), scale_(scale) {}

  // A half, or nothing. Fails with kSystem where the block is too small for a half.
  [[nodiscard, gnu::noinline]] std::expected<Reading, PortError> read(
      std::span<Sample> block) noexcept {
    if (block.size() < kRows) return std::unexpected{PortError::kSystem};
    std::array<AdcRow, kRows> rows;
    const auto taken = buffer_.take(rows);
    if (!taken) return Reading{.count = 0, .lost = 0};
    // The count of halves wraps after a while; what passed since the last one does not.
    halves_ += static_cast<std::uint32_t>(taken->index - static_cast<std::uint32_t>(halves_));
    for (std::size_t k = 0; k < kRows; ++k) {
      block[k] = to_sample(scale_, rows[k], halves_ * kRows + k);
    }
    return Reading{.count = kRows, .lost = taken->lost * static_cast<std::uint32_t>(kRows)};
  }

 private:
  DoubleBuffer<AdcRow, kRows>& buffer_;
  AdcScale scale_;
  std::uint64_t halves_ = 0;
};
static_assert(SampleSource<AdcSource<5>>);

}  // namespace cutforce::hal::cortex_m
