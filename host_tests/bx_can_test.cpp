#include <gtest/gtest.h>

#include <array>
#include <cstdint>

#include "hal/cortex_m/bx_can.hpp"
#include "support/fake_bx_can.hpp"

namespace cutforce::host_tests {
namespace {

using hal::BusState;
using hal::SendError;
using hal::can::Frame;
using hal::cortex_m::BxCanError;
using hal::cortex_m::BxCanTiming;
using Driver = hal::cortex_m::BxCan<FakeBxCanRegisters>;

// 500 kbit/s of 54 MHz, the sample point at 83 %.
constexpr BxCanTiming kTiming{.prescaler = 6, .segment_1 = 14, .segment_2 = 3, .jump = 1};
static_assert(kTiming.check() && kTiming.rate_hz(54'000'000) == 500'000);

constexpr Frame kFrame{.id = 0x181, .length = 5, .data = {1, 2, 3, 4, 0xFF}};

struct Bus {
  FakeBxCan fake{};
  Driver driver{FakeBxCanRegisters{&fake}};
};

void expect_no_mistakes(const FakeBxCan& fake) {
  for (const auto& mistake : fake.mistakes()) ADD_FAILURE() << mistake;
}

TEST(BxCan, WakesFromResetAndStartsWithTheTimingItWasGiven) {
  Bus bus;
  ASSERT_TRUE(bus.driver.start(kTiming));
  EXPECT_EQ(bus.fake.bit_timing(), 0U << 24 | 2U << 20 | 13U << 16 | 5U);
  EXPECT_TRUE(bus.fake.in_order());
  EXPECT_EQ(bus.driver.status().state, BusState::kActive);
  EXPECT_EQ(bus.driver.status().restarts, 0U);
  expect_no_mistakes(bus.fake);
}

TEST(BxCan, RefusesATimingThatTheRegistersCannotHold) {
  constexpr std::array<BxCanTiming, 6> kWrong{{{0, 14, 3, 1},
                                               {1025, 14, 3, 1},
                                               {6, 17, 3, 1},
                                               {6, 14, 9, 1},
                                               {6, 14, 3, 4},
                                               {6, 14, 3, 0}}};
  for (const auto& timing : kWrong) {
    Bus bus;
    const auto started = bus.driver.start(timing);
    ASSERT_FALSE(started);
    EXPECT_EQ(started.error(), BxCanError::kTiming);
  }
}

TEST(BxCan, GivesUpOnAControllerThatDoesNotAnswer) {
  Bus bus;
  bus.fake.clocked = false;
  const auto started = bus.driver.start(kTiming);
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error(), BxCanError::kNoAnswer);
  EXPECT_EQ(bus.driver.status().state, BusState::kDown);
  EXPECT_EQ(bus.driver.send(kFrame).error(), SendError::kDown);
}

TEST(BxCan, GivesUpOnABusThatIsNeverIdle) {
  Bus bus;
  bus.fake.bus_idle = false;
  const auto started = bus.driver.start(kTiming);
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error(), BxCanError::kBusStuck);
  EXPECT_EQ(bus.driver.send(kFrame).error(), SendError::kDown);
}

TEST(BxCan, SendsEveryKindOfFrameAsTheMailboxWantsIt) {
  Bus bus;
  ASSERT_TRUE(bus.driver.start(kTiming));
  Frame extended = kFrame;
  extended.extended = true;
  extended.id = 0x1234'5678;
  Frame remote = kFrame;
  remote.remote = true;
  for (const Frame& frame : {kFrame, extended, remote}) ASSERT_TRUE(bus.driver.send(frame));
  ASSERT_EQ(bus.fake.on_bus.size(), 3U);
  EXPECT_EQ(bus.fake.on_bus[0].id, 0x181U << 21);
  EXPECT_EQ(bus.fake.on_bus[0].length, 5U);
  EXPECT_EQ(bus.fake.on_bus[0].low, 0x0403'0201U);
  EXPECT_EQ(bus.fake.on_bus[0].high, 0x0000'00FFU);
  EXPECT_EQ(bus.fake.on_bus[1].id, 0x1234'5678U << 3 | 4U);
  EXPECT_EQ(bus.fake.on_bus[2].id, 0x181U << 21 | 2U);
  expect_no_mistakes(bus.fake);
}

TEST(BxCan, KeepsAnIdentifierThatIsTooLargeOutOfTheOtherBits) {
  Bus bus;
  ASSERT_TRUE(bus.driver.start(kTiming));
  Frame frame = kFrame;
  frame.id = 0xFFFF'FFFF;
  frame.length = 200;
  ASSERT_TRUE(bus.driver.send(frame));
  EXPECT_EQ(bus.fake.on_bus[0].id, 0x7FFU << 21);
  EXPECT_EQ(bus.fake.on_bus[0].length, 8U);
}

TEST(BxCan, HasRoomForThreeFramesAndCountsWhatFindsNone) {
  Bus bus;
  ASSERT_TRUE(bus.driver.start(kTiming));
  for (int k = 0; k < 3; ++k) ASSERT_TRUE(bus.driver.send(kFrame));
  EXPECT_EQ(bus.driver.send(kFrame).error(), SendError::kNoRoom);
  EXPECT_EQ(bus.driver.send(kFrame).error(), SendError::kNoRoom);
  EXPECT_EQ(bus.driver.status().unsent, 2U);
  bus.fake.send_one();
  EXPECT_TRUE(bus.driver.send(kFrame));
  EXPECT_EQ(bus.driver.status().unsent, 2U);
  expect_no_mistakes(bus.fake);  // above all: it never wrote to a mailbox that was waiting
}

TEST(BxCan, SendsAThousandFramesThroughMailboxesThatEmptyAtTheirOwnPace) {
  Bus bus;
  ASSERT_TRUE(bus.driver.start(kTiming));
  std::uint32_t random = 1;
  std::uint32_t sent = 0;
  while (sent < 1000) {
    Frame frame = kFrame;
    frame.data[0] = static_cast<std::uint8_t>(sent);
    frame.data[1] = static_cast<std::uint8_t>(sent >> 8);
    if (bus.driver.send(frame)) ++sent;
    random = random * 1664525U + 1013904223U;
    for (std::uint32_t k = random >> 30; k > 0; --k) bus.fake.send_one();
  }
  ASSERT_EQ(bus.fake.on_bus.size(), 1000U);
  for (std::uint32_t k = 0; k < 1000; ++k) ASSERT_EQ(bus.fake.on_bus[k].low & 0xFFFFU, k);
  expect_no_mistakes(bus.fake);
}

TEST(BxCan, ReceivesWhatTheFifoHoldsAndReleasesIt) {
  Bus bus;
  ASSERT_TRUE(bus.driver.start(kTiming));
  bus.fake.deliver({0x123U << 21, 8, 0x4433'2211, 0x8877'6655});
  bus.fake.deliver({0x1ABC'DEF0U << 3 | 4U, 2, 0xBBAA, 0xFFFF'FFFF});
  bus.fake.deliver({0x700U << 21 | 2U, 3, 0x1234, 0});
  std::array<Frame, 2> frames{};
  ASSERT_EQ(bus.driver.receive(frames).value(), 2U);
  EXPECT_EQ(
      frames[0],
      (Frame{.id = 0x123, .length = 8, .data = {0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88}}));
  EXPECT_EQ(frames[1],
            (Frame{.id = 0x1ABC'DEF0, .length = 2, .extended = true, .data = {0xAA, 0xBB}}));
  ASSERT_EQ(bus.driver.receive(frames).value(), 1U);
  EXPECT_EQ(frames[0], (Frame{.id = 0x700, .length = 3, .remote = true}));
  EXPECT_EQ(bus.driver.receive(frames).value(), 0U);
}

// A length code of 9 to 15 stands for eight bytes (RM0090, CAN_RDTxR).
TEST(BxCan, TakesALengthBeyondEightForEight) {
  Bus bus;
  ASSERT_TRUE(bus.driver.start(kTiming));
  bus.fake.deliver({0x123U << 21, 15, 1, 2});
  std::array<Frame, 1> frames{};
  ASSERT_EQ(bus.driver.receive(frames).value(), 1U);
  EXPECT_EQ(frames[0].length, 8);
}

TEST(BxCan, CountsAnOverrunOnceAndGoesOn) {
  Bus bus;
  ASSERT_TRUE(bus.driver.start(kTiming));
  for (std::uint32_t k = 0; k < 5; ++k) bus.fake.deliver({k << 21, 0, 0, 0});
  std::array<Frame, 8> frames{};
  EXPECT_EQ(bus.driver.receive(frames).value(), 3U);
  EXPECT_EQ(bus.driver.status().overrun, 1U);
  EXPECT_EQ(bus.driver.receive(frames).value(), 0U);
  EXPECT_EQ(bus.driver.status().overrun, 1U);
}

TEST(BxCan, TellsWarningPassiveAndOff) {
  Bus bus;
  ASSERT_TRUE(bus.driver.start(kTiming));
  bus.fake.tec = 96;
  EXPECT_EQ(bus.driver.status().state, BusState::kWarning);
  bus.fake.tec = 128;
  EXPECT_EQ(bus.driver.status().state, BusState::kPassive);
  bus.fake.go_off();
  EXPECT_EQ(bus.driver.status().state, BusState::kOff);
  EXPECT_EQ(bus.driver.send(kFrame).error(), SendError::kDown);
}

TEST(BxCan, ComesBackFromBusOffOnlyByARestartThatGivesUpWhatWaited) {
  Bus bus;
  ASSERT_TRUE(bus.driver.start(kTiming));
  for (int k = 0; k < 3; ++k) ASSERT_TRUE(bus.driver.send(kFrame));
  bus.fake.go_off();
  EXPECT_EQ(bus.driver.status().state, BusState::kOff);
  EXPECT_EQ(bus.driver.status().state, BusState::kOff);
  ASSERT_TRUE(bus.driver.start(kTiming));
  EXPECT_EQ(bus.fake.waiting(), 0U);
  EXPECT_EQ(bus.driver.status().state, BusState::kActive);
  EXPECT_EQ(bus.driver.status().restarts, 1U);
  EXPECT_TRUE(bus.driver.send(kFrame));
  expect_no_mistakes(bus.fake);
}

TEST(BxCan, SaysThatNobodyAcknowledgesUntilSomebodyDoes) {
  constexpr std::uint32_t kAcknowledgementError = 3;
  constexpr std::uint32_t kStuffError = 1;
  Bus bus;
  ASSERT_TRUE(bus.driver.start(kTiming));
  ASSERT_TRUE(bus.driver.send(kFrame));
  bus.fake.send_one();
  EXPECT_TRUE(bus.driver.status().acknowledged);
  for (int k = 0; k < 2; ++k) ASSERT_TRUE(bus.driver.send(kFrame));
  bus.fake.send_one();
  bus.fake.error(kAcknowledgementError);
  EXPECT_FALSE(bus.driver.status().acknowledged);
  EXPECT_FALSE(bus.driver.status().acknowledged);  // the frame before, which was, is no excuse
  bus.fake.error(kStuffError);
  EXPECT_FALSE(bus.driver.status().acknowledged);
  bus.fake.send_one();
  EXPECT_TRUE(bus.driver.status().acknowledged);
  EXPECT_EQ(bus.driver.status().error_frames, 2U);
}

}  // namespace
}  // namespace cutforce::host_tests
