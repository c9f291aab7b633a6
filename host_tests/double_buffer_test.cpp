#include <gtest/gtest.h>

#include <array>
#include <cstdint>

#include "hal/cortex_m/adc_source.hpp"
#include "hal/cortex_m/double_buffer.hpp"

namespace cutforce::host_tests {
namespace {

using hal::Sample;
using hal::Signal;
using hal::cortex_m::AdcRow;
using hal::cortex_m::AdcScale;
using hal::cortex_m::AdcSource;
using Buffer = hal::cortex_m::DoubleBuffer<std::uint32_t, 4>;
using Rows = std::array<std::uint32_t, 4>;

// What a DMA does: row by row, whether anybody reads or not.
template <class B>
void fill(B& buffer, std::uint32_t value) {
  for (auto& row : buffer.filling()) row = value;
  buffer.complete();
}

TEST(DoubleBuffer, HandsOverEachHalfOnceInItsOrder) {
  Buffer buffer;
  Rows rows{};
  EXPECT_FALSE(buffer.take(rows));
  for (std::uint32_t k = 0; k < 100; ++k) {
    fill(buffer, k);
    const auto taken = buffer.take(rows);
    ASSERT_TRUE(taken);
    EXPECT_EQ(taken->index, k);
    EXPECT_EQ(taken->lost, 0U);
    EXPECT_EQ(rows, (Rows{k, k, k, k}));
    EXPECT_FALSE(buffer.take(rows));
  }
  EXPECT_EQ(buffer.overruns(), 0U);
}

TEST(DoubleBuffer, FillsTheMemoryInTurnAsACircularDmaDoes) {
  Buffer buffer;
  EXPECT_EQ(buffer.memory().size(), 8U);
  EXPECT_EQ(buffer.filling().data(), buffer.memory().data());
  buffer.complete();
  EXPECT_EQ(buffer.filling().data(), buffer.memory().data() + 4);
  buffer.complete();
  EXPECT_EQ(buffer.filling().data(), buffer.memory().data());
}

// A reader that sleeps gets the newest whole half, and is told how many it missed.
TEST(DoubleBuffer, GivesTheNewestHalfAndCountsTheLost) {
  for (std::uint32_t missed = 0; missed < 10; ++missed) {
    SCOPED_TRACE(missed);
    Buffer buffer;
    for (std::uint32_t k = 0; k <= missed; ++k) fill(buffer, k);
    Rows rows{};
    const auto taken = buffer.take(rows);
    ASSERT_TRUE(taken);
    EXPECT_EQ(taken->index, missed);
    EXPECT_EQ(taken->lost, missed);
    EXPECT_EQ(rows, (Rows{missed, missed, missed, missed}));
    EXPECT_EQ(buffer.overruns(), missed);
  }
}

// A row whose copying is interrupted by the end of the next half, so that the device is already
// writing where the reader is still reading.
struct InterruptingRow {
  std::uint32_t value = 0;
  static inline hal::cortex_m::DoubleBuffer<InterruptingRow, 4>* buffer = nullptr;

  InterruptingRow() = default;
  InterruptingRow(const InterruptingRow&) = default;
  InterruptingRow& operator=(const InterruptingRow& other) {
    value = other.value;
    if (auto* const interrupted = std::exchange(buffer, nullptr)) interrupted->complete();
    return *this;
  }
};

TEST(DoubleBuffer, DropsAHalfThatIsFilledAgainWhileItIsRead) {
  hal::cortex_m::DoubleBuffer<InterruptingRow, 4> buffer;
  std::array<InterruptingRow, 4> rows;
  buffer.complete();
  InterruptingRow::buffer = &buffer;
  EXPECT_FALSE(buffer.take(rows));
  EXPECT_EQ(buffer.overruns(), 1U);
  const auto taken = buffer.take(rows);
  ASSERT_TRUE(taken);
  EXPECT_EQ(taken->index, 1U);
  EXPECT_EQ(taken->lost, 1U);
  EXPECT_EQ(buffer.overruns(), 1U);
}

constexpr AdcScale kScale{.gain = {0.5F, 0.5F, 0.5F, 0.01F, 0.01F, 0.01F, 0.0F, -2.0F},
                          .zero = {2048, 2048, 2048, 2000, 2000, 2000, 0, 100},
                          .first_ns = 1'000,
                          .period_ns = 200'000};

TEST(AdcSource, MakesSiUnitsOfCountsAndLeavesOutWhatHasNoChannel) {
  constexpr AdcRow kRow{{2048, 2050, 2046, 2000, 2100, 1900, 77, 50}};
  const Sample sample = hal::cortex_m::to_sample(kScale, kRow, 3);
  EXPECT_EQ(sample.time_ns, 601'000);
  EXPECT_EQ(sample.voltage_v, (std::array<float, 3>{0.0F, 1.0F, -1.0F}));
  EXPECT_EQ(sample.current_a, (std::array<float, 3>{0.0F, 1.0F, -1.0F}));
  EXPECT_FALSE(sample.has(Signal::kSpeed));
  EXPECT_EQ(sample.speed_rad_s, 0.0F);
  EXPECT_TRUE(sample.has(Signal::kPowerMeter));
  EXPECT_EQ(sample.power_meter_w, 100.0F);
  EXPECT_FALSE(sample.has(Signal::kEnable));
}

TEST(AdcSource, KeepsTheTimeOverRowsThatWereLost) {
  hal::cortex_m::DoubleBuffer<AdcRow, 2> buffer;
  AdcSource source(buffer, kScale);
  std::array<Sample, 2> block{};
  EXPECT_EQ(source.read(block).value().count, 0U);
  const auto row = [](std::uint16_t count) {
    AdcRow made{};
    made.counts.fill(count);
    return made;
  };
  const auto halves = [&](int count) {
    for (int k = 0; k < count; ++k) {
      for (AdcRow& filled : buffer.filling()) filled = row(7);
      buffer.complete();
    }
  };
  halves(1);
  auto reading = source.read(block).value();
  EXPECT_EQ(reading.count, 2U);
  EXPECT_EQ(reading.lost, 0U);
  EXPECT_EQ(block[1].time_ns, 201'000);
  halves(3);
  reading = source.read(block).value();
  EXPECT_EQ(reading.lost, 4U);
  EXPECT_EQ(block[0].time_ns, 1'000 + 6 * 200'000);
  EXPECT_EQ(block[1].time_ns, 1'000 + 7 * 200'000);
}

TEST(AdcSource, RefusesABlockThatHoldsNoHalf) {
  hal::cortex_m::DoubleBuffer<AdcRow, 2> buffer;
  AdcSource source(buffer, kScale);
  Sample block{};
  EXPECT_EQ(source.read(std::span(&block, 1)).error(), hal::PortError::kSystem);
}

}  // namespace
}  // namespace cutforce::host_tests
