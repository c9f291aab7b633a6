#include "hal/linux/gpio_config.hpp"

#include <gtest/gtest.h>

#include <cerrno>

#include "hal/linux/gpio_byte.hpp"

namespace cutforce::hal::os {
namespace {

GpioConfig sound() {
  return {.chip = "gpiochip0",
          .data = {16, 17, 18, 19, 20, 21, 22, 23},
          .data_active_low = false,
          .strobe = {24, false},
          .alive = GpioLine{25, false},
          .alarm = {},
          .acknowledge = GpioLine{5, true},
          .inhibit = {},
          .initial_byte = 0,
          .setup_us = 50,
          .hold_us = 50,
          .consumer = "cutforce"};
}

const std::vector<GpioChip> kChips{{"/dev/gpiochip0", "gpiochip0", "pinctrl-bcm2835", 54},
                                   {"/dev/gpiochip1", "gpiochip1", "9030000.pl061", 8}};

bool says(const OpenError& error, const char* words) {
  return error.text().find(words) != std::string::npos;
}

TEST(GpioConfig, FindsTheChipByPathNameOrLabel) {
  for (const auto* chip : {"/dev/gpiochip0", "gpiochip0", "pinctrl-bcm2835"}) {
    auto config = sound();
    config.chip = chip;
    ASSERT_TRUE(check(config));
    EXPECT_EQ(choose(config, kChips).value().path, "/dev/gpiochip0");
  }
}

TEST(GpioConfig, ListsTheChipsWhereTheOneNamedIsNotThere) {
  auto config = sound();
  config.chip = "gpiochip7";
  const auto refused = choose(config, kChips);
  ASSERT_FALSE(refused);
  EXPECT_TRUE(says(refused.error(), "gpiochip0 [pinctrl-bcm2835], gpiochip1 [9030000.pl061]"));
  EXPECT_TRUE(says(choose(config, {}).error(), "load the driver"));
}

TEST(GpioConfig, SaysHowManyLinesTheChipHas) {
  auto config = sound();
  config.chip = "gpiochip1";
  const auto refused = choose(config, kChips);
  ASSERT_FALSE(refused);
  EXPECT_TRUE(says(refused.error(), "data 0 is line 16, but the chip has 8"));
}

TEST(GpioConfig, RefusesALineWithTwoRoles) {
  auto config = sound();
  config.alarm = GpioLine{18, false};
  const auto refused = check(config);
  ASSERT_FALSE(refused);
  EXPECT_TRUE(says(refused.error(), "line 18 is both data 2 and alarm"));
}

TEST(GpioConfig, RefusesAWrongNumberOfDataLinesAndTimesOutOfRange) {
  auto seven = sound();
  seven.data.pop_back();
  EXPECT_FALSE(check(seven));
  auto four = sound();
  four.data.resize(4);
  EXPECT_TRUE(check(four));
  for (const std::uint32_t time_us : {0U, 10'001U}) {
    auto setup = sound();
    setup.setup_us = time_us;
    EXPECT_FALSE(check(setup));
    auto hold = sound();
    hold.hold_us = time_us;
    EXPECT_FALSE(check(hold));
  }
}

TEST(GpioConfig, NamesWhoHoldsALine) {
  const auto busy = line_refused(sound(), {"data 3", 19}, "GPIO19", "GPIO Key Poweroff", EBUSY);
  EXPECT_TRUE(says(busy, "data 3, line 19 (GPIO19) is held by \"GPIO Key Poweroff\""));
  EXPECT_TRUE(says(line_refused(sound(), {"strobe", 24}, "", "", EBUSY), "held by the kernel"));
  EXPECT_TRUE(says(line_refused(sound(), {"strobe", 24}, "", "", EACCES), "group gpio"));
}

TEST(GpioByte, IsRefusedInWordsWhereTheChipIsNotThere) {
  auto config = sound();
  config.chip = "no-such-chip";
  const auto refused = GpioByte::open(config);
  ASSERT_FALSE(refused);
  EXPECT_TRUE(says(refused.error(), "GPIO chip no-such-chip: there is no such chip"));
}

}  // namespace
}  // namespace cutforce::hal::os
