#include "firmware/board_report.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <vector>

#include "control/supervisor.hpp"

namespace cutforce::firmware {
namespace {

using control::Reason;
using control::SupervisorState;
using hal::can::Base;
using hal::can::Frame;
using hal::can::identifier;

constexpr std::uint8_t kNode = 5;
constexpr std::int64_t kTick_ns = 1'000'000;

BoardValues values(SupervisorState state, std::uint8_t override_pct,
                   Reason reason = Reason::kNone) {
  BoardValues values{};
  values.state = values.override.state = static_cast<std::uint8_t>(state);
  values.reason = values.override.reason = static_cast<std::uint8_t>(reason);
  values.override.override_pct = override_pct;
  return values;
}

bool is(const std::optional<Frame>& frame, Base base) {
  return frame && frame->id == identifier(base, kNode);
}

// Frames of `ticks` ticks, all of which can be sent.
std::map<std::uint32_t, int> counted(BoardReport& report, const BoardValues& what, int ticks,
                                     std::int64_t& now_ns) {
  std::map<std::uint32_t, int> count;
  for (int k = 0; k < ticks; ++k, now_ns += kTick_ns) {
    if (const auto frame = report.due(now_ns, what)) {
      ++count[frame->id];
      report.sent();
    }
  }
  return count;
}

TEST(BoardReport, KeepsTheCyclesOfTheContract) {
  BoardReport report(kNode);
  std::int64_t now_ns = 123;
  const auto count = counted(report, values(SupervisorState::kReady, 100), 10'000, now_ns);
  EXPECT_EQ(count.at(identifier(Base::kOverride, kNode)), 500);
  EXPECT_EQ(count.at(identifier(Base::kEstimate, kNode)), 200);
  EXPECT_EQ(count.at(identifier(Base::kDiagnostics, kNode)), 40);
  EXPECT_EQ(count.at(identifier(Base::kHeartbeat, kNode)), 100);
  EXPECT_EQ(count.size(), 4U);
}

TEST(BoardReport, SendsAChangedOverrideAtTheNextTickButNotInAFlood) {
  BoardReport report(kNode);
  std::int64_t now_ns = 0;
  counted(report, values(SupervisorState::kControl, 100), 103, now_ns);
  EXPECT_TRUE(is(report.due(now_ns, values(SupervisorState::kControl, 99)), Base::kOverride));
  report.sent();
  // Changing at every tick: one frame in two milliseconds.
  int overrides = 0;
  for (int k = 0; k < 1000; ++k) {
    now_ns += kTick_ns;
    const auto frame = report.due(
        now_ns, values(SupervisorState::kControl, static_cast<std::uint8_t>(40 + k % 100)));
    overrides += is(frame, Base::kOverride) ? 1 : 0;
    if (frame) report.sent();
  }
  EXPECT_LE(overrides, 500);
  EXPECT_GE(overrides, 450);
}

TEST(BoardReport, KeepsNothingThatCouldNotBeSent) {
  BoardReport report(kNode);
  std::int64_t now_ns = 0;
  counted(report, values(SupervisorState::kControl, 100), 100, now_ns);
  for (int k = 0; k < 5000; ++k, now_ns += kTick_ns) {  // the bus is off
    static_cast<void>(report.due(now_ns, values(SupervisorState::kControl, 100)));
  }
  const auto first = report.due(now_ns, values(SupervisorState::kControl, 61));
  ASSERT_TRUE(is(first, Base::kOverride));
  EXPECT_EQ(hal::can::unpack<hal::can::Override>(*first)->override_pct, 61);
  report.sent();
  // No burst afterwards: each kind once, then its cycle.
  const auto count = counted(report, values(SupervisorState::kControl, 61), 40, now_ns);
  EXPECT_LE(count.at(identifier(Base::kOverride, kNode)), 3);
  EXPECT_EQ(count.at(identifier(Base::kEstimate, kNode)), 1);
  EXPECT_EQ(count.at(identifier(Base::kHeartbeat, kNode)), 1);
}

TEST(BoardReport, CountsOnlyFramesThatWereSent) {
  BoardReport report(kNode);
  std::vector<std::uint8_t> counters;
  std::int64_t now_ns = 0;
  for (int k = 0; k < 20'000; ++k, now_ns += kTick_ns) {
    const auto frame = report.due(now_ns, values(SupervisorState::kReady, 100));
    if (!frame || k % 3 == 0) continue;
    if (is(frame, Base::kOverride)) counters.push_back(frame->data[2]);
    report.sent();
  }
  ASSERT_GT(counters.size(), 600U);
  for (std::size_t k = 1; k < counters.size(); ++k) {
    EXPECT_EQ(counters[k], static_cast<std::uint8_t>(counters[k - 1] + 1)) << k;
  }
}

TEST(BoardReport, SaysAFaultOnceFirstAndTakesItBackOnce) {
  BoardReport report(kNode);
  std::int64_t now_ns = 0;
  counted(report, values(SupervisorState::kControl, 100), 50, now_ns);
  const auto fault = values(SupervisorState::kSafe, 100, Reason::kSignalFault);
  const auto first = report.due(now_ns, fault);
  ASSERT_TRUE(is(first, Base::kEmergency));
  const auto told = hal::can::unpack<hal::can::Emergency>(*first);
  EXPECT_EQ(told->error_code, 0x5000);
  EXPECT_EQ(told->reason, static_cast<std::uint8_t>(Reason::kSignalFault));
  // As long as it was not sent, it is what is due.
  EXPECT_TRUE(is(report.due(now_ns += kTick_ns, fault), Base::kEmergency));
  report.sent();
  EXPECT_EQ(counted(report, fault, 1000, now_ns).count(identifier(Base::kEmergency, kNode)), 0U);
  const auto other = values(SupervisorState::kLinkLost, 70, Reason::kLinkTimeout);
  EXPECT_EQ(counted(report, other, 1000, now_ns)[identifier(Base::kEmergency, kNode)], 1);
  const auto well = report.due(now_ns, values(SupervisorState::kReady, 100));
  ASSERT_TRUE(is(well, Base::kEmergency));
  EXPECT_EQ(hal::can::unpack<hal::can::Emergency>(*well)->error_code, 0);
  report.sent();
  EXPECT_EQ(counted(report, values(SupervisorState::kReady, 100), 1000, now_ns)
                .count(identifier(Base::kEmergency, kNode)),
            0U);
}

TEST(BoardReport, TellsItsStateAsCiA301Does) {
  const auto nmt = [](SupervisorState state) {
    BoardReport report(kNode);
    for (std::int64_t now_ns = 0; now_ns < 10 * kTick_ns; now_ns += kTick_ns) {
      const auto frame = report.due(now_ns, values(state, 100, Reason::kNone));
      if (is(frame, Base::kHeartbeat)) return frame->data[0];
      report.sent();
    }
    return std::uint8_t{255};
  };
  EXPECT_EQ(nmt(SupervisorState::kBoot), 0);
  EXPECT_EQ(nmt(SupervisorState::kCheck), 127);
  EXPECT_EQ(nmt(SupervisorState::kReady), 5);
  EXPECT_EQ(nmt(SupervisorState::kHold), 5);
  EXPECT_EQ(nmt(SupervisorState::kSafe), 4);
}

}  // namespace
}  // namespace cutforce::firmware
