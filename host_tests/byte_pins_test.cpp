#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "hal/cortex_m/byte_pins.hpp"

namespace cutforce::host_tests {
namespace {

using namespace hal::cortex_m;

// Sixteen pins as an STM32 drives them, and what a receiver sees of them: it looks at the data when
// the strobe rises.
struct Port {
  std::uint32_t pins = 0;
  std::uint32_t inputs = 0;
  std::vector<std::uint8_t> received{};
  std::vector<std::uint32_t> data_seen{};  // the data lines after each store
  std::vector<std::uint32_t> waits{};
  int stores = 0;
};

struct Stm32Port {
  Port* port;
  std::uint32_t load(std::size_t offset) const { return offset == 0x10 ? port->inputs : 0; }
  void store(std::size_t offset, std::uint32_t value) const {
    ASSERT_EQ(offset, 0x18U);
    const std::uint32_t before = port->pins;
    port->pins = (before & ~(value >> 16)) | (value & 0xFFFFU);
    note(before);
  }
  void note(std::uint32_t before) const {
    ++port->stores;
    port->data_seen.push_back(port->pins & 0xFFU);
    if ((~before & port->pins & 0x100U) != 0) {
      port->received.push_back(static_cast<std::uint8_t>(port->pins));
    }
  }
};

struct CmsdkPort : Stm32Port {
  std::uint32_t load(std::size_t offset) const { return offset == 0 ? port->inputs : 0; }
  void store(std::size_t offset, std::uint32_t value) const {
    const bool high = offset >= 0x800;
    const auto mask = static_cast<std::uint32_t>((offset & 0x3FFU) / 4) << (high ? 8 : 0);
    const std::uint32_t before = port->pins;
    port->pins = (before & ~mask) | (value & mask);
    note(before);
  }
};

struct Wait {
  Port* port;
  void operator()(std::uint32_t nanoseconds) const { port->waits.push_back(nanoseconds); }
};

constexpr BytePinsConfig kConfig{
    .setup_ns = 100, .hold_ns = 300, .strobe_high = true, .acknowledge = true, .inhibit = true};

template <class Pins, class R>
void expect_every_byte_to_arrive_whole() {
  Port port;
  BytePins<Pins, R, Wait> pins(R{&port}, Wait{&port}, kConfig);
  std::vector<std::uint8_t> sent;
  for (std::uint32_t k = 0; k < 256; ++k) {
    const auto byte = static_cast<std::uint8_t>(k * 85);  // many lines change at once
    port.data_seen.clear();
    const std::uint32_t before = port.pins & 0xFFU;
    ASSERT_TRUE(pins.write({.byte = byte, .alive = k % 2 == 0, .alarm = false, .again = false}));
    sent.push_back(byte);
    for (const std::uint32_t seen : port.data_seen) EXPECT_TRUE(seen == before || seen == byte);
  }
  EXPECT_EQ(port.received, sent);
}

TEST(BytePins, ChangeAllDataLinesWithOneStore) {
  expect_every_byte_to_arrive_whole<Stm32Pins, Stm32Port>();
  expect_every_byte_to_arrive_whole<CmsdkPins, CmsdkPort>();
}

TEST(BytePins, WaitForSetUpBeforeTheStrobeAndForHoldAfterIt) {
  Port port;
  BytePins<Stm32Pins, Stm32Port, Wait> pins(Stm32Port{&port}, Wait{&port}, kConfig);
  ASSERT_TRUE(pins.write({.byte = 1, .alive = false, .alarm = false, .again = false}));
  EXPECT_EQ(port.waits, (std::vector<std::uint32_t>{100, 300}));
  EXPECT_EQ(port.pins & 0x100U, 0U);
}

TEST(BytePins, StrobeAByteOnceUnlessAskedToAgain) {
  Port port;
  BytePins<Stm32Pins, Stm32Port, Wait> pins(Stm32Port{&port}, Wait{&port}, kConfig);
  const hal::ByteOutput same{.byte = 0, .alive = false, .alarm = false, .again = false};
  for (int k = 0; k < 5; ++k) ASSERT_TRUE(pins.write(same));
  EXPECT_EQ(port.received.size(), 1U);  // even the first, which is 0
  auto again = same;
  again.again = true;
  ASSERT_TRUE(pins.write(again));
  EXPECT_EQ(port.received.size(), 2U);
}

TEST(BytePins, LeaveTheStrobeOfTheOtherPolarityHighWhereItRests) {
  Port port;
  auto config = kConfig;
  config.strobe_high = false;
  BytePins<Stm32Pins, Stm32Port, Wait> pins(Stm32Port{&port}, Wait{&port}, config);
  ASSERT_TRUE(pins.write({.byte = 9, .alive = false, .alarm = false, .again = false}));
  EXPECT_NE(port.pins & 0x100U, 0U);
}

TEST(BytePins, MoveAliveAndAlarmWithoutTouchingTheByte) {
  Port port;
  BytePins<Stm32Pins, Stm32Port, Wait> pins(Stm32Port{&port}, Wait{&port}, kConfig);
  ASSERT_TRUE(pins.write({.byte = 0xA5, .alive = false, .alarm = false, .again = false}));
  ASSERT_TRUE(pins.write({.byte = 0xA5, .alive = true, .alarm = true, .again = false}));
  EXPECT_EQ(port.pins, 0x6A5U);
  ASSERT_TRUE(pins.write({.byte = 0xA5, .alive = false, .alarm = true, .again = false}));
  EXPECT_EQ(port.pins, 0x4A5U);
}

TEST(BytePins, ReadTheInputsWhereThereAreAny) {
  Port port;
  BytePins<Stm32Pins, Stm32Port, Wait> wired(Stm32Port{&port}, Wait{&port}, kConfig);
  BytePins<Stm32Pins, Stm32Port, Wait> bare(
      Stm32Port{&port}, Wait{&port},
      {.setup_ns = 0, .hold_ns = 0, .strobe_high = true, .acknowledge = false, .inhibit = false});
  const hal::ByteOutput output{.byte = 0, .alive = false, .alarm = false, .again = false};
  EXPECT_FALSE(wired.write(output)->acknowledged);
  EXPECT_FALSE(wired.write(output)->inhibit);
  port.inputs = 1U << 11 | 1U << 12;
  EXPECT_TRUE(wired.write(output)->acknowledged);
  EXPECT_TRUE(wired.write(output)->inhibit);
  EXPECT_FALSE(bare.write(output)->inhibit);
  port.inputs = 0;
  EXPECT_TRUE(bare.write(output)->acknowledged);
}

}  // namespace
}  // namespace cutforce::host_tests
