// gpio_lines_v2.cpp over the stand-in. A program of its own: it cannot share one with libgpiod 1.6.
#include <gtest/gtest.h>

#include "hal/linux/gpio_byte.hpp"
#include "libgpiod_v2/stand_in.hpp"

// /dev of this machine may have no chip; the stand-in opens whatever is named.
namespace cutforce::hal::os {
std::vector<std::string> gpio_device_paths() { return {"/dev/gpiochip0"}; }
}  // namespace cutforce::hal::os

namespace cutforce::host_tests {
namespace {

using hal::os::GpioByte;
using hal::os::GpioConfig;
using hal::os::GpioLine;

class GpioByteOverV2 : public testing::Test {
 protected:
  GpioByteOverV2() { stand_in = {}; }
  ~GpioByteOverV2() override { EXPECT_EQ(stand_in.alive_objects, 0) << "the library's own leaked"; }

  GpioConfig config{.chip = "stand-in",
                    .data = {0, 1, 2, 3, 4, 5, 6, 7},
                    .data_active_low = true,
                    .strobe = {8, false},
                    .alive = GpioLine{9, false},
                    .alarm = GpioLine{10, true},
                    .acknowledge = GpioLine{11, false},
                    .inhibit = GpioLine{12, true},
                    .initial_byte = 0x5A,
                    .setup_us = 1,
                    .hold_us = 1,
                    .consumer = "cutforce"};

  [[nodiscard]] static unsigned byte_on_lines() {
    unsigned byte = 0;
    for (unsigned i = 0; i < 8; ++i) byte |= static_cast<unsigned>(stand_in.level[i]) << i;
    return byte;
  }
};

TEST_F(GpioByteOverV2, RequestsAllLinesWithTheirSafeLevels) {
  const auto port = GpioByte::open(config);
  ASSERT_TRUE(port) << port.error().text();
  EXPECT_EQ(byte_on_lines(), 0x5AU);
  EXPECT_EQ(stand_in.consumer, "cutforce");
  for (unsigned i = 0; i < 13; ++i) EXPECT_TRUE(stand_in.requested[i]) << i;
  for (unsigned i = 0; i < 11; ++i) EXPECT_TRUE(stand_in.output[i]) << i;
  for (unsigned i = 8; i < 11; ++i) EXPECT_EQ(stand_in.level[i], 0) << i;
  EXPECT_FALSE(stand_in.output[11] || stand_in.output[12]);
  EXPECT_TRUE(stand_in.active_low[0] && stand_in.active_low[10] && stand_in.active_low[12]);
  EXPECT_FALSE(stand_in.active_low[8]);
}

TEST_F(GpioByteOverV2, WritesTheDataBeforeTheStrobeForEveryByte) {
  auto port = GpioByte::open(config);
  ASSERT_TRUE(port);
  for (unsigned byte = 0; byte < 256; ++byte) {
    stand_in.changes.clear();
    ASSERT_TRUE(port->write(
        {.byte = static_cast<std::uint8_t>(byte), .alive = false, .alarm = false, .again = false}));
    EXPECT_EQ(byte_on_lines(), byte);
    const auto count = stand_in.changes.size();
    ASSERT_GE(count, 2U);
    EXPECT_EQ(stand_in.changes[count - 2], std::pair(8U, 1));
    EXPECT_EQ(stand_in.changes[count - 1], std::pair(8U, 0));
    for (std::size_t i = 0; i + 2 < count; ++i) EXPECT_LT(stand_in.changes[i].first, 8U);
  }
}

TEST_F(GpioByteOverV2, LeavesTheLastByteAndNoSignOfLife) {
  {
    auto port = GpioByte::open(config);
    ASSERT_TRUE(port && port->write({.byte = 9, .alive = true, .alarm = true, .again = false}));
    EXPECT_EQ(stand_in.level[9] + stand_in.level[10], 2);
  }
  EXPECT_EQ(byte_on_lines(), 9U);
  EXPECT_EQ(stand_in.level[9], 0);
}

TEST_F(GpioByteOverV2, ReadsTheCncsLinesAndReportsARefusal) {
  auto port = GpioByte::open(config);
  ASSERT_TRUE(port);
  stand_in.level[12] = 1;
  const auto input = port->write({.byte = 1, .alive = true, .alarm = false, .again = false});
  ASSERT_TRUE(input);
  EXPECT_TRUE(input->inhibit);
  stand_in.refuse = true;
  EXPECT_FALSE(port->write({.byte = 2, .alive = true, .alarm = false, .again = false}));
}

TEST_F(GpioByteOverV2, DrivesOnlyFourLinesWhereThereAreFour) {
  config.data = {3, 2, 1, 0};
  config.initial_byte = 0;
  auto port = GpioByte::open(config);
  ASSERT_TRUE(port && port->write({.byte = 0xF1, .alive = true, .alarm = false, .again = false}));
  EXPECT_EQ(byte_on_lines(), 0x08U);
}

TEST_F(GpioByteOverV2, NamesWhoHoldsALine) {
  stand_in.busy_line = 8;
  const auto refused = GpioByte::open(config);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().what, "strobe, line 8 is held by \"spi0 CS0\"");
}

}  // namespace
}  // namespace cutforce::host_tests
