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
using Kind = BoardReport::Kind;

constexpr std::int64_t kTick_ns = 1'000'000;

BoardReport::Headline headline(SupervisorState state, std::uint32_t override_pct,
                               Reason reason = Reason::kNone) {
  return {.override_pct = override_pct,
          .state = static_cast<std::uint32_t>(state),
          .reason = static_cast<std::uint32_t>(reason)};
}

// Frames of `ticks` ticks, all of which can be sent.
std::map<Kind, int> counted(BoardReport& report, const BoardReport::Headline& what, int ticks,
                            std::int64_t& now_ns) {
  std::map<Kind, int> count;
  for (int k = 0; k < ticks; ++k, now_ns += kTick_ns) {
    if (const Kind kind = report.due(now_ns, what); kind != Kind::kNone) {
      ++count[kind];
      report.sent();
    }
  }
  return count;
}

TEST(BoardReport, KeepsTheCyclesOfTheContract) {
  BoardReport report;
  std::int64_t now_ns = 123;
  const auto count = counted(report, headline(SupervisorState::kReady, 100), 10'000, now_ns);
  EXPECT_EQ(count, (std::map<Kind, int>{{Kind::kOverride, 500},
                                        {Kind::kHeartbeat, 100},
                                        {Kind::kEstimate, 200},
                                        {Kind::kDiagnostics, 40}}));
}

TEST(BoardReport, SendsAChangedOverrideAtTheNextTickButNotInAFlood) {
  BoardReport report;
  std::int64_t now_ns = 0;
  counted(report, headline(SupervisorState::kControl, 100), 103, now_ns);
  EXPECT_EQ(report.due(now_ns, headline(SupervisorState::kControl, 99)), Kind::kOverride);
  report.sent();
  // Changing at every tick: one frame in two milliseconds.
  int overrides = 0;
  for (int k = 0; k < 1000; ++k) {
    now_ns += kTick_ns;
    const auto changed = static_cast<std::uint32_t>(40 + k % 100);
    const Kind kind = report.due(now_ns, headline(SupervisorState::kControl, changed));
    overrides += kind == Kind::kOverride ? 1 : 0;
    if (kind != Kind::kNone) report.sent();
  }
  EXPECT_LE(overrides, 500);
  EXPECT_GE(overrides, 450);
}

TEST(BoardReport, KeepsNothingThatCouldNotBeSent) {
  BoardReport report;
  std::int64_t now_ns = 0;
  counted(report, headline(SupervisorState::kControl, 100), 100, now_ns);
  for (int k = 0; k < 5000; ++k, now_ns += kTick_ns) {  // the bus is off
    static_cast<void>(report.due(now_ns, headline(SupervisorState::kControl, 100)));
  }
  const auto newest = headline(SupervisorState::kControl, 61);
  ASSERT_EQ(report.due(now_ns, newest), Kind::kOverride);
  EXPECT_FALSE(report.has_told(newest));
  report.sent();
  EXPECT_TRUE(report.has_told(newest));
  // No burst afterwards: each kind once, then its cycle.
  const auto count = counted(report, newest, 40, now_ns);
  EXPECT_LE(count.at(Kind::kOverride), 3);
  EXPECT_EQ(count.at(Kind::kEstimate), 1);
  EXPECT_EQ(count.at(Kind::kHeartbeat), 1);
}

TEST(BoardReport, CountsOnlyFramesThatWereSent) {
  BoardReport report;
  std::vector<std::uint8_t> counters;
  std::int64_t now_ns = 0;
  for (int k = 0; k < 20'000; ++k, now_ns += kTick_ns) {
    const Kind kind = report.due(now_ns, headline(SupervisorState::kReady, 100));
    if (kind == Kind::kNone || k % 3 == 0) continue;
    if (kind == Kind::kOverride) counters.push_back(report.counter());
    report.sent();
  }
  ASSERT_GT(counters.size(), 600U);
  for (std::size_t k = 1; k < counters.size(); ++k) {
    EXPECT_EQ(counters[k], static_cast<std::uint8_t>(counters[k - 1] + 1)) << k;
  }
}

TEST(BoardReport, SaysAFaultOnceFirstAndTakesItBackOnce) {
  BoardReport report;
  std::int64_t now_ns = 0;
  counted(report, headline(SupervisorState::kControl, 100), 50, now_ns);
  const auto fault = headline(SupervisorState::kSafe, 100, Reason::kSignalFault);
  ASSERT_EQ(report.due(now_ns, fault), Kind::kEmergency);
  // As long as it was not sent, it is what is due.
  EXPECT_EQ(report.due(now_ns += kTick_ns, fault), Kind::kEmergency);
  report.sent();
  EXPECT_EQ(counted(report, fault, 1000, now_ns).count(Kind::kEmergency), 0U);
  const auto other = headline(SupervisorState::kLinkLost, 70, Reason::kLinkTimeout);
  EXPECT_EQ(counted(report, other, 1000, now_ns)[Kind::kEmergency], 1);
  const auto well = headline(SupervisorState::kReady, 100);
  EXPECT_EQ(counted(report, well, 1000, now_ns)[Kind::kEmergency], 1);
  EXPECT_EQ(counted(report, well, 1000, now_ns).count(Kind::kEmergency), 0U);
}

TEST(BoardReport, NamesAFaultAsCiA301Does) {
  const auto fault = emergency_message(headline(SupervisorState::kSafe, 100, Reason::kSignalFault));
  EXPECT_EQ(fault.error_code, 0x5000);
  EXPECT_EQ(fault.error_register, 0x01);
  EXPECT_EQ(fault.state, static_cast<std::uint8_t>(SupervisorState::kSafe));
  EXPECT_EQ(fault.reason, static_cast<std::uint8_t>(Reason::kSignalFault));
  const auto link =
      emergency_message(headline(SupervisorState::kLinkLost, 70, Reason::kLinkTimeout));
  EXPECT_EQ(link.error_code, 0x8130);
  EXPECT_EQ(link.error_register, 0x11);
  const auto well = emergency_message(headline(SupervisorState::kReady, 100));
  EXPECT_EQ(well.error_code, 0);
  EXPECT_EQ(well.error_register, 0);
}

TEST(BoardReport, TellsItsStateAsCiA301Does) {
  const auto nmt = [](SupervisorState state) {
    return heartbeat_message(headline(state, 100)).nmt_state;
  };
  EXPECT_EQ(nmt(SupervisorState::kBoot), 0);
  EXPECT_EQ(nmt(SupervisorState::kCheck), 127);
  EXPECT_EQ(nmt(SupervisorState::kReady), 5);
  EXPECT_EQ(nmt(SupervisorState::kHold), 5);
  EXPECT_EQ(nmt(SupervisorState::kSafe), 4);
}

}  // namespace
}  // namespace cutforce::firmware
