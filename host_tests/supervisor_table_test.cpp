// The supervisor's table: every pair of state and event, and all that can come together. FAULTS 3.
#include "control/supervisor_table.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <tuple>

#include "control/supervisor.hpp"
#include "support/supervisor_bench.hpp"

namespace cutforce::control {
namespace {

using host_tests::authority;
using S = SupervisorState;

// What one event alone does, by state; whatever is not named leaves the state as it is. Written
// from FAULTS 2.2, not from the table.
constexpr struct {
  S state;
  EventSet event;
  S next;
} kSingle[] = {
    {S::kSelfTest, kSelfTestPasses, S::kCheck},
    {S::kCheck, kChecksPass, S::kReady},
    {S::kReady, kArmEdge, S::kMonitor},
    {S::kReady, kChecksFail, S::kCheck},
    {S::kReady, kOutputFailed, S::kSafe},
    {S::kReady, kForeignNode, S::kSafe},
    {S::kReady, kBusIsDown, S::kLinkLost},
    {S::kReady, kLinkLate, S::kLinkLost},
    {S::kMonitor, kArmLow, S::kReady},
    {S::kMonitor, kControlEdge, S::kControl},
    {S::kMonitor, kOutputFailed, S::kSafe},
    {S::kMonitor, kForeignNode, S::kSafe},
    {S::kMonitor, kBusIsDown, S::kLinkLost},
    {S::kMonitor, kLinkLate, S::kLinkLost},
    {S::kControl, kArmLow, S::kReady},
    {S::kControl, kControlLow, S::kMonitor},
    {S::kControl, kOutputFailed, S::kSafe},
    {S::kControl, kForeignNode, S::kSafe},
    {S::kControl, kBusIsDown, S::kLinkLost},
    {S::kControl, kLinkLate, S::kLinkLost},
    {S::kControl, kForceOver, S::kProtect},
    {S::kControl, kSamplesGone, S::kSafe},
    {S::kControl, kSignalsRefused, S::kSafe},
    {S::kControl, kEstimateGone, S::kSafe},
    {S::kControl, kSamplesLate, S::kHold},
    {S::kControl, kInhibit, S::kHold},
    {S::kControl, kThreads, S::kHold},
    {S::kControl, kSpindleOff, S::kHold},
    {S::kControl, kOverran, S::kHold},
    {S::kHold, kArmLow, S::kReady},
    {S::kHold, kControlLow, S::kMonitor},
    {S::kHold, kOutputFailed, S::kSafe},
    {S::kHold, kForeignNode, S::kSafe},
    {S::kHold, kBusIsDown, S::kLinkLost},
    {S::kHold, kLinkLate, S::kLinkLost},
    {S::kHold, kForceOver, S::kProtect},
    {S::kHold, kSamplesGone, S::kSafe},
    {S::kHold, kSignalsRefused, S::kSafe},
    {S::kHold, kCalm, S::kControl},
    {S::kLinkLost, kOutputFailed, S::kSafe},
    {S::kLinkLost, kForeignNode, S::kSafe},
    {S::kProtect, kOutputFailed, S::kSafe},
    {S::kProtect, kForeignNode, S::kSafe},
};

S next_of(S state, EventSet events) {
  const Transition* row = transition(state, events);
  return row == nullptr ? state : row->next;
}

TEST(SupervisorTable, AnswersEveryPairOfStateAndEvent) {
  int pairs = 0;
  for (unsigned k = 0; k < kSupervisorStateCount; ++k) {
    const auto state = static_cast<S>(k);
    for (unsigned e = 0; e < kEventCount; ++e) {
      const EventSet event = 1U << e;
      S expected = state == S::kBoot ? S::kSelfTest : state;
      if (event == kStop) expected = S::kDead;
      for (const auto& single : kSingle) {
        if (single.state == state && single.event == event) expected = single.next;
      }
      EXPECT_EQ(next_of(state, event), expected) << k << " on " << kEventNames[e];
      ++pairs;
    }
  }
  EXPECT_EQ(pairs, 11 * 28);
  EXPECT_EQ(next_of(S::kLinkLost, kArmEdge | kLinkOk), S::kReady);
  EXPECT_EQ(next_of(S::kProtect, kResetEdge | kProtectClear), S::kReady);
  EXPECT_EQ(next_of(S::kSafe, kResetEdge | kSafeClear), S::kReady);
}

// The search is left out where no trigger has come: never where the table has a row.
TEST(SupervisorTable, OverlooksNoRowWhateverComesTogether) {
  std::mt19937 random(5);
  int taken = 0;
  for (int run = 0; run < 2'000'000; ++run) {
    const auto state = static_cast<S>(random() % kSupervisorStateCount);
    EventSet events = static_cast<EventSet>(random());
    for (int k = run % 8; k > 0; --k) events &= static_cast<EventSet>(random());
    events &= (1U << kEventCount) - 1;
    const Transition* expected = nullptr;
    for (const Transition& row : kTransitions) {
      const bool applies = (row.states & only(state)) != 0 && (row.events & ~events) == 0;
      if (applies && expected == nullptr) expected = &row;
    }
    ASSERT_EQ(transition(state, events), expected) << static_cast<int>(state) << " " << events;
    taken += expected != nullptr ? 1 : 0;
  }
  EXPECT_GT(taken, 500'000);
  EXPECT_LT(taken, 1'500'000);
}

TEST(SupervisorTable, LeadsUpOnlyByAPersonWhateverComesTogether) {
  std::mt19937 random(4);
  for (int run = 0; run < 2'000'000; ++run) {
    const auto state = static_cast<S>(random() % kSupervisorStateCount);
    EventSet events = static_cast<EventSet>(random());
    if (run % 2 == 0) events &= static_cast<EventSet>(random());
    events &= ~kByPerson & ((1U << kEventCount) - 1);
    const S next = next_of(state, events);
    const bool start = state == S::kCheck && next == S::kReady;
    ASSERT_TRUE(start || authority(next) <= authority(state)) << run;
    if ((events & kStop) != 0) {
      ASSERT_EQ(next, S::kDead);
    } else if ((events & (kOutputFailed | kForeignNode)) != 0 && authority(state) > 0) {
      ASSERT_EQ(next, S::kSafe);
    } else if ((events & kForceOver) != 0 && (state == S::kControl || state == S::kHold)) {
      ASSERT_EQ(next, S::kProtect);
    }
  }
}

}  // namespace
}  // namespace cutforce::control
