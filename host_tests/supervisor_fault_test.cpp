// Lost links, faults, the hard limit and missed ticks: what the supervisor does, each on its own.
#include <gtest/gtest.h>

#include <limits>

#include "control/supervisor.hpp"
#include "support/supervisor_bench.hpp"

namespace cutforce::control {
namespace {

using host_tests::bench_in;
using host_tests::sound_input;
using host_tests::SupervisorBench;
using S = SupervisorState;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

TEST(Supervisor, LosesTheLinkOneTickAfterItsTimeAndDoesNotResume) {
  for (const S state : {S::kReady, S::kMonitor, S::kControl, S::kHold}) {
    auto bench = bench_in(state);
    bench.input.inhibit = state == S::kHold;
    const int before = bench.output.override_pct;
    bench.input.machine_state_new = false;
    EXPECT_EQ(bench.step(250), state);
    EXPECT_EQ(bench.step(), S::kLinkLost);
    EXPECT_EQ(bench.output.reason, Reason::kLinkTimeout);
    EXPECT_EQ(bench.output.override_pct, before);
    EXPECT_TRUE(bench.output.alarm && bench.output.alive && !bench.output.silent);
    bench.input = sound_input();
    bench.input.arm = bench.input.control = true;  // as before
    EXPECT_EQ(bench.step(20'000), S::kLinkLost);
    const bool controlled = state == S::kControl || state == S::kHold;
    EXPECT_EQ(bench.output.override_pct, controlled ? 70 : 100);
    bench.input.arm = false;
    bench.step();
    bench.input.arm = true;
    EXPECT_EQ(bench.step(), S::kReady);
    EXPECT_EQ(bench.step(1000), S::kReady);  // that edge has acknowledged; arming takes another
    bench.input.arm = false;
    bench.step();
    bench.input.arm = true;
    EXPECT_EQ(bench.step(), S::kMonitor);
    EXPECT_EQ(bench.step(1000), S::kMonitor);
  }
}

TEST(Supervisor, IsSilentWhileTheBusIsDownAndNeedsAFreshLowAfterwards) {
  auto bench = bench_in(S::kControl);
  bench.input.bus_down = true;
  bench.input.machine_state_new = false;
  EXPECT_EQ(bench.step(), S::kLinkLost);
  EXPECT_EQ(bench.output.reason, Reason::kBusDown);
  EXPECT_TRUE(bench.output.silent);
  bench.input.arm = false;  // nobody says so: there is no link
  bench.step(10);
  bench.input.bus_down = false;
  bench.input.machine_state_new = bench.input.arm = true;
  EXPECT_EQ(bench.step(100), S::kLinkLost);
  EXPECT_FALSE(bench.output.silent);
}

// 5 % a second from min(last, 100) to 70 %, and from below it stays.
TEST(Supervisor, FallsAfterAFaultAndNeverRises) {
  for (const int last : {150, 100, 90, 60, 20}) {
    auto bench = bench_in(S::kControl);
    bench.input.override_pct = static_cast<std::uint8_t>(last);
    bench.step();
    bench.input.output_failed = true;
    bench.step();
    EXPECT_EQ(bench.output.state, S::kSafe);
    EXPECT_TRUE(bench.output.alarm && !bench.output.alive && !bench.output.controlling);
    const int begin = std::min(last, 100);
    EXPECT_EQ(bench.output.override_pct, begin);
    bench.input.override_pct = 200;
    int before = begin;
    for (int ms = 1; ms <= 10'000; ++ms) {
      bench.step();
      ASSERT_LE(bench.output.override_pct, before);
      before = bench.output.override_pct;
      if (ms == 2000) {
        EXPECT_EQ(before, std::max(begin - 10, std::min(begin, 70)));
      }
    }
    EXPECT_EQ(before, std::min(last, 70));
  }
}

TEST(Supervisor, GoesToSafeOnFaultsInControlAndWaitsForArmLowAndReset) {
  const struct {
    void (*spoil)(Supervisor::Input&);
    int after;
    Reason reason;
  } cases[] = {
      {[](auto& i) { i.output_failed = true; }, 1, Reason::kOutput},
      {[](auto& i) { i.foreign = true; }, 1, Reason::kForeign},
      {[](auto& i) { i.signals_refused = true; }, 1, Reason::kSignalFault},
      {[](auto& i) { i.sample_new = false; }, 201, Reason::kSamplesMissing},
      {[](auto& i) { i.force_new = false; }, 2001, Reason::kEstimateLost},
      {[](auto& i) { i.force_n = kNan; }, 2001, Reason::kEstimateLost},
      {[](auto& i) { i.force_n = kInfinity; }, 2001, Reason::kEstimateLost},
  };
  for (const auto& c : cases) {
    auto bench = bench_in(S::kControl);
    c.spoil(bench.input);
    bench.step(c.after - 1);
    EXPECT_NE(bench.output.state, S::kSafe);
    EXPECT_EQ(bench.step(), S::kSafe);
    EXPECT_EQ(bench.output.reason, c.reason);
    const auto press = [&bench] {
      bench.input.reset = false;
      bench.step();
      bench.input.reset = true;
      return bench.step();
    };
    if (c.reason != Reason::kEstimateLost) {
      bench.input.arm = false;
      EXPECT_EQ(press(), S::kSafe);  // the cause is still there
    }
    bench.input = sound_input();
    bench.input.arm = true;
    EXPECT_EQ(press(), S::kSafe);  // armed
    bench.input.arm = false;
    EXPECT_EQ(bench.step(1000), S::kSafe);  // reset is still high
    EXPECT_EQ(press(), S::kReady);
    EXPECT_EQ(bench.output.reason, Reason::kNone);
  }
}

TEST(Supervisor, FreezesWhenSamplesAreLateAndResumesIfTheyCome) {
  auto bench = bench_in(S::kControl);
  bench.input.sample_new = false;
  EXPECT_EQ(bench.step(100), S::kControl);
  EXPECT_EQ(bench.step(), S::kHold);
  EXPECT_EQ(bench.output.reason, Reason::kSamplesMissing);
  bench.input.sample_new = true;
  EXPECT_EQ(bench.step(499), S::kHold);
  EXPECT_EQ(bench.step(), S::kControl);
}

// One force is noise; two of three are not. The hold goes out in the step of the second.
TEST(Supervisor, AsksForFeedHoldOnTwoOfThreeForcesOverTheLimit) {
  for (const S state : {S::kControl, S::kHold}) {
    for (const unsigned pattern : {0b101U, 0b110U, 0b011U, 0b111U}) {
      auto bench = bench_in(state);
      bench.input.inhibit = state == S::kHold;
      unsigned over = 0;
      for (unsigned bit = 0; bit < 3; ++bit) {
        bench.input.force_new = false;  // steps without an estimate do not count
        bench.step(5);
        bench.input.force_new = true;
        bench.input.force_n = (pattern >> (2 - bit) & 1U) != 0 ? 1001.0F : 1000.0F;
        over += bench.input.force_n > 1000.0F;
        bench.step();
        if (over >= 2) break;
        EXPECT_EQ(bench.output.state, state);
      }
      EXPECT_EQ(bench.output.state, S::kProtect);
      EXPECT_EQ(bench.output.override_pct, 0);
      EXPECT_TRUE(bench.output.alarm && bench.output.alive);
      EXPECT_FALSE(bench.output.permission.enable || bench.output.permission.may_rise);
    }
  }
}

TEST(Supervisor, OnlyRaisesAlarmOverTheLimitWhileItMonitors) {
  auto bench = bench_in(S::kMonitor);
  bench.input.force_n = 3000.0F;
  EXPECT_EQ(bench.step(10), S::kMonitor);
  EXPECT_EQ(bench.output.override_pct, 100);
  EXPECT_TRUE(bench.output.alarm);
  bench.input.force_n = 100.0F;
  bench.step(10);
  EXPECT_TRUE(bench.output.alarm);
  bench.input.reset = true;
  bench.step();
  EXPECT_FALSE(bench.output.alarm);
}

TEST(Supervisor, LeavesProtectOnlyByResetWithLowForceAndNoFeed) {
  const auto press = [](SupervisorBench& bench) {
    bench.input.reset = false;
    bench.step();
    bench.input.reset = true;
    return bench.step();
  };
  auto bench = bench_in(S::kProtect);
  EXPECT_EQ(press(bench), S::kProtect);  // feeding
  bench.input.feeding = false;
  bench.input.force_n = 500.0F;
  EXPECT_EQ(press(bench), S::kProtect);
  bench.input.force_n = 499.0F;
  bench.input.reset = false;
  EXPECT_EQ(bench.step(1000), S::kProtect);
  EXPECT_EQ(press(bench), S::kReady);
  EXPECT_EQ(bench.output.override_pct, 0);  // up only from the next step on, with the controller
  bench.input.override_pct = 20;
  bench.step();
  EXPECT_EQ(bench.output.override_pct, 20);

  auto still = bench_in(S::kProtect);  // a spindle at rest has no force at all
  still.input.feeding = still.input.spindle_at_speed = still.input.force_new = false;
  still.supervisor.restore([&] {
    auto state = still.supervisor.state();
    state.force_n = 3000.0F;
    return state;
  }());
  EXPECT_EQ(press(still), S::kProtect);
  still.step(2001);
  EXPECT_EQ(press(still), S::kReady);
}

TEST(Supervisor, KeepsTheHardLimitWhereTheLinkIsLostOrTheOutputFails) {
  auto lost = bench_in(S::kLinkLost);
  lost.input.force_n = 3000.0F;
  lost.step(2);
  EXPECT_EQ(lost.output.state, S::kProtect);
  EXPECT_EQ(lost.output.override_pct, 0);
  auto safe = bench_in(S::kSafe);
  safe.input.force_n = 3000.0F;
  safe.step(2);
  EXPECT_EQ(safe.output.state, S::kSafe);
  EXPECT_EQ(safe.output.override_pct, 0);
  SupervisorBench idle = bench_in(S::kMonitor);  // not ours to stop
  idle.input.bus_down = true;
  idle.input.force_n = 3000.0F;
  EXPECT_EQ(idle.step(10), S::kLinkLost);
  EXPECT_EQ(idle.output.override_pct, 100);
}

TEST(Supervisor, CountsMissedTicksAndFreezesBeyondOnePercentOrThreeInARow) {
  auto bench = bench_in(S::kControl);
  bench.input.missed_ticks = 2;
  EXPECT_EQ(bench.step(), S::kControl);
  bench.input.missed_ticks = 0;
  bench.step();
  bench.input.missed_ticks = 3;
  EXPECT_EQ(bench.step(), S::kHold);
  EXPECT_EQ(bench.output.reason, Reason::kOverrun);

  auto row = bench_in(S::kControl);
  row.input.missed_ticks = 1;
  EXPECT_EQ(row.step(2), S::kControl);
  EXPECT_EQ(row.step(), S::kHold);

  const auto misses_held = [](int misses, int apart) {
    auto spread = bench_in(S::kControl);
    for (int i = 0; i < misses; ++i) {
      spread.input.missed_ticks = 1;
      if (spread.step() != S::kControl) return true;
      spread.input.missed_ticks = 0;
      if (spread.step(apart - 1) != S::kControl) return true;
    }
    return false;
  };
  EXPECT_FALSE(misses_held(10, 50));
  EXPECT_TRUE(misses_held(11, 50));
  EXPECT_FALSE(misses_held(1000, 150));  // 7 in any second
}

// A stall makes the link old at once, and the frame that comes after it young again.
TEST(Supervisor, CountsMissedTicksAsTime) {
  auto bench = bench_in(S::kControl);
  bench.input.machine_state_new = false;
  bench.input.missed_ticks = 249;
  EXPECT_EQ(bench.step(), S::kHold);
  bench.input.missed_ticks = 0;
  EXPECT_EQ(bench.step(), S::kLinkLost);
  auto heard = bench_in(S::kControl);
  heard.input.missed_ticks = 100'000;
  EXPECT_EQ(heard.step(), S::kHold);
  heard.input.missed_ticks = std::numeric_limits<std::uint32_t>::max();
  EXPECT_EQ(heard.step(5), S::kHold);
}

}  // namespace
}  // namespace cutforce::control
