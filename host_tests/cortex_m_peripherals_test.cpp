// Drivers of hal/cortex_m against blocks of registers that behave, and the words for faults.
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>

#include "hal/cortex_m/fault_text.hpp"
#include "hal/cortex_m/timer.hpp"
#include "hal/cortex_m/uart.hpp"
#include "hal/cortex_m/watchdog.hpp"

namespace cutforce::host_tests {
namespace {

using namespace hal::cortex_m;

// A transmitter that is busy for three looks after each character.
struct FakeUart {
  std::string sent{};
  std::deque<std::uint8_t> waiting{};
  int busy = 0;
  int lost = 0;
  std::uint32_t control = 0;
  std::uint32_t divider = 0;
};
struct UartRegisters {
  FakeUart* fake;
  std::uint32_t load(std::size_t offset) const {
    if (offset == 0x04) {
      if (fake->busy > 0) --fake->busy;
      return (fake->busy > 0 ? 1U : 0U) | (fake->waiting.empty() ? 0U : 2U);
    }
    if (offset != 0x00 || fake->waiting.empty()) return 0;
    const std::uint8_t value = fake->waiting.front();
    fake->waiting.pop_front();
    return value;
  }
  void store(std::size_t offset, std::uint32_t value) const {
    if (offset == 0x08) fake->control = value;
    if (offset == 0x10) fake->divider = value;
    if (offset != 0x00) return;
    if (fake->busy > 0) ++fake->lost;
    fake->sent += static_cast<char>(value);
    fake->busy = 3;
  }
};

TEST(CmsdkUart, SendsEveryCharacterAndWaitsForRoom) {
  FakeUart fake;
  CmsdkUart uart{UartRegisters{&fake}};
  uart.start(217);
  EXPECT_EQ(fake.control, 3U);
  EXPECT_EQ(fake.divider, 217U);
  std::string text;
  for (int k = 1; k < 256; ++k) text += static_cast<char>(k);
  uart.send(text);
  EXPECT_EQ(fake.sent, text);
  EXPECT_EQ(fake.lost, 0);
}

TEST(CmsdkUart, ReceivesWhatHasComeAndNothingElse) {
  FakeUart fake;
  CmsdkUart uart{UartRegisters{&fake}};
  uart.start(16);
  EXPECT_FALSE(uart.receive());
  fake.waiting = {0, 255};
  EXPECT_EQ(uart.receive(), 0);
  EXPECT_EQ(uart.receive(), 255);
  EXPECT_FALSE(uart.receive());
}

// Locked against everything until the key is written.
struct FakeWatchdog {
  bool locked = true;
  std::uint32_t load = ~0U;
  std::uint32_t value = ~0U;
  std::uint32_t control = 0;
  int refused = 0;
};
struct WatchdogRegisters {
  FakeWatchdog* fake;
  std::uint32_t load(std::size_t offset) const { return offset == 4 ? fake->value : 0; }
  void store(std::size_t offset, std::uint32_t value) const {
    if (offset == 0xC00) {
      fake->locked = value != 0x1ACCE551;
      return;
    }
    if (fake->locked) {
      ++fake->refused;
      return;
    }
    if (offset == 0x0) fake->load = fake->value = value;
    if (offset == 0x8) fake->control = value;
    if (offset == 0xC) fake->value = fake->load;
  }
};

TEST(CmsdkWatchdog, IsUnlockedOnlyWhileItIsTouched) {
  FakeWatchdog fake;
  CmsdkWatchdog watchdog{WatchdogRegisters{&fake}};
  watchdog.start(1000);
  EXPECT_EQ(fake.control, 3U);
  EXPECT_TRUE(fake.locked);
  fake.value = 1;
  watchdog.feed();
  EXPECT_EQ(watchdog.left_ticks(), 1000U);
  EXPECT_TRUE(fake.locked);
  EXPECT_EQ(fake.refused, 0);
}

// Counts down by seven with each look.
struct CountingTimer {
  std::uint32_t* value;
  std::uint32_t load(std::size_t) const { return *value -= 7; }
  void store(std::size_t offset, std::uint32_t written) const {
    if (offset == 4) *value = written;
  }
};

TEST(CmsdkTimer, WaitsLongEnoughAlsoOverTheEndOfTheCount) {
  for (const std::uint32_t begin : {1'000'000U, 100U, 3U, 0U}) {
    std::uint32_t value = 0;
    CmsdkTimer timer(CountingTimer{&value}, 25'000'000);
    timer.start();
    value = begin + 7;
    timer.wait(41'000);  // 1025 ticks
    EXPECT_GE(begin - value, 1025U);
    EXPECT_LE(begin - value, 1025U + 14U);
  }
}

std::string told(std::uint32_t cfsr, std::uint32_t hfsr, std::uint32_t mmfar, std::uint32_t bfar) {
  std::string text;
  tell_fault(
      "memory fault", cfsr, hfsr, mmfar, bfar, [&](std::string_view part) { text += part; },
      [](std::uint32_t address) { return address >= 0x1FFF'0000 && address < 0x2000'0000; });
  return text;
}

TEST(FaultText, NamesAStackThatRanIntoItsGuard) {
  EXPECT_EQ(told(0x82, 0, 0x1FFF'FFFC, 0),
            "FAULT memory fault, CFSR 0x00000082, HFSR 0x00000000, MMFAR 0x1ffffffc\n"
            "  data access that the memory protection forbids\n"
            "  the stack has overflowed into its guard\n");
  // Entering the handler failed: the address may be missing, the reason is the same.
  EXPECT_NE(told(0x10, 0, 0, 0).find("overflowed"), std::string::npos);
  EXPECT_NE(told(0x8200, 0, 0, 0x1FFF'0000).find("overflowed"), std::string::npos);
}

TEST(FaultText, DoesNotBlameTheStackForAnAddressElsewhere) {
  EXPECT_EQ(told(0x82, 0, 0x2000'0000, 0).find("overflowed"), std::string::npos);
  // An address register that is not valid says nothing, whatever it holds.
  EXPECT_EQ(told(0x02, 0, 0x1FFF'FFFC, 0).find("overflowed"), std::string::npos);
  EXPECT_EQ(told(0x02, 0, 0x1FFF'FFFC, 0).find("MMFAR"), std::string::npos);
}

TEST(FaultText, HasAWordForEveryBitAndNoBitTwice) {
  std::uint32_t seen = 0;
  for (const auto& bit : kFaultBits) {
    EXPECT_EQ(seen & bit.mask, 0U) << bit.words;
    seen |= bit.mask;
    EXPECT_NE(told(bit.mask, 0, 0, 0).find(bit.words), std::string::npos);
  }
  EXPECT_EQ(seen, 0x031F'3F3BU);  // all but the two that say whether an address is valid
  for (const auto& bit : kHardFaultBits) {
    EXPECT_NE(told(0, bit.mask, 0, 0).find(bit.words), std::string::npos);
  }
}

}  // namespace
}  // namespace cutforce::host_tests
