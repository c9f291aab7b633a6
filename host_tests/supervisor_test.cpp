// Start, arming, control and hold, each rule on its own. Faults: supervisor_fault_test.cpp;
// whatever order they come in: supervisor_walk_test.cpp.
#include "control/supervisor.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "support/supervisor_bench.hpp"

namespace cutforce::control {
namespace {

using host_tests::bench_in;
using host_tests::kSupervised;
using host_tests::sound_input;
using host_tests::SupervisorBench;
using S = SupervisorState;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

TEST(Supervisor, ComesUpOverSelfTestAndChecksToReady) {
  SupervisorBench bench;
  bench.input.self_test_done = bench.input.checks_passed = false;
  EXPECT_EQ(bench.step(), S::kSelfTest);
  EXPECT_TRUE(bench.output.silent);
  EXPECT_EQ(bench.step(100), S::kSelfTest);
  bench.input.self_test_done = true;
  bench.input.self_test_passed = false;
  EXPECT_EQ(bench.step(), S::kSelfTest);
  EXPECT_EQ(bench.output.reason, Reason::kSelfTestFailed);
  bench.input.self_test_passed = true;
  EXPECT_EQ(bench.step(), S::kCheck);
  EXPECT_FALSE(bench.output.silent);
  EXPECT_EQ(bench.step(), S::kCheck);
  EXPECT_EQ(bench.output.reason, Reason::kCheckFailed);
  EXPECT_FALSE(bench.output.alive);
  bench.input.checks_passed = true;
  bench.input.override_pct = 100;
  EXPECT_EQ(bench.step(), S::kReady);
  EXPECT_TRUE(bench.output.alive);
  EXPECT_FALSE(bench.output.alarm || bench.output.controlling || bench.output.permission.enable);
  EXPECT_EQ(bench.output.override_pct, 100);
}

TEST(Supervisor, StaysInCheckUntilACncIsHeard) {
  SupervisorBench bench;
  bench.input.machine_state_new = false;
  EXPECT_EQ(bench.step(1000), S::kCheck);
  EXPECT_EQ(bench.output.reason, Reason::kLinkTimeout);
  bench.input.machine_state_new = true;
  EXPECT_EQ(bench.step(), S::kReady);

  auto alone = kSupervised;
  alone.link_required = false;
  SupervisorBench lines(alone);
  lines.input.machine_state_new = false;
  lines.input.bus_down = true;
  EXPECT_EQ(lines.step(1000), S::kReady);
}

// A level that was high all along is no edge, of any of the buttons.
TEST(Supervisor, TakesOnlyEdgesOfALevelSeenLowInTheSameState) {
  SupervisorBench bench;
  bench.input.arm = bench.input.control = bench.input.reset = true;
  EXPECT_EQ(bench.step(1000), S::kReady);
  bench.input.arm = false;
  EXPECT_EQ(bench.step(), S::kReady);
  bench.input.arm = true;
  EXPECT_EQ(bench.step(), S::kMonitor);
  EXPECT_EQ(bench.step(1000), S::kMonitor);  // control was high before
  bench.input.control = false;
  EXPECT_EQ(bench.step(), S::kMonitor);
  bench.input.control = true;
  EXPECT_EQ(bench.step(), S::kControl);
}

// Pressed in the very step that enters kReady: nobody has seen arm low in kReady.
TEST(Supervisor, DoesNotArmOnAnEdgeThatComesWithTheState) {
  SupervisorBench bench;
  EXPECT_EQ(bench.lead_to(S::kCheck), S::kCheck);
  EXPECT_EQ(bench.step(), S::kReady);
  bench.input.arm = true;
  EXPECT_EQ(bench.step(), S::kReady);
  bench.input.arm = false;
  bench.step();
  bench.input.arm = true;
  EXPECT_EQ(bench.step(), S::kMonitor);
}

TEST(Supervisor, NeverControlsWhereItOnlyAdvises) {
  auto advise = kSupervised;
  advise.mode = SupervisorMode::kAdvise;
  auto bench = bench_in(S::kMonitor, advise);
  for (int i = 0; i < 100; ++i) {
    bench.input.control = i % 2 == 0;
    EXPECT_EQ(bench.step(), S::kMonitor);
    EXPECT_FALSE(bench.output.permission.enable);
  }
}

TEST(Supervisor, RefusesControlWithItsReason) {
  const struct {
    void (*spoil)(Supervisor::Input&);
    Reason reason;
  } cases[] = {
      {[](auto& i) { i.inhibit = true; }, Reason::kInhibited},
      {[](auto& i) { i.threading = true; }, Reason::kThreading},
      {[](auto& i) { i.reversed = true; }, Reason::kThreading},
      {[](auto& i) { i.spindle_at_speed = false; }, Reason::kSpindle},
      {[](auto& i) { i.signals_refused = true; }, Reason::kSignalFault},
      {[](auto& i) { i.missed_ticks = 3; }, Reason::kOverrun},
      {[](auto& i) { i.sample_new = false; }, Reason::kSamplesMissing},
      {[](auto& i) { i.force_n = 3000.0F; }, Reason::kForceLimit},
  };
  for (const auto& c : cases) {
    auto bench = bench_in(S::kMonitor);
    c.spoil(bench.input);
    EXPECT_EQ(bench.step(150), S::kMonitor);
    bench.input.control = true;
    EXPECT_EQ(bench.step(), S::kMonitor);
    EXPECT_EQ(bench.output.reason, c.reason);
    const bool held = bench.input.control;
    const bool armed = bench.input.arm;
    bench.input = sound_input();
    bench.input.arm = armed;
    bench.input.control = held;
    EXPECT_EQ(bench.step(3000), S::kMonitor);  // a refused edge is used up
    bench.input.control = false;
    bench.step();
    bench.input.control = true;
    EXPECT_EQ(bench.step(), S::kControl);
  }
}

TEST(Supervisor, GivesBackWhenALevelFalls) {
  for (const S state : {S::kControl, S::kHold}) {
    auto control = bench_in(state);
    control.input.control = false;
    EXPECT_EQ(control.step(), S::kMonitor);
    auto arm = bench_in(state);
    arm.input.arm = false;
    EXPECT_EQ(arm.step(), S::kReady);
    EXPECT_EQ(arm.output.override_pct, 80);  // and from there as the controller goes
    arm.input.override_pct = 90;
    arm.step();
    EXPECT_EQ(arm.output.override_pct, 90);
    arm.input.override_pct = 130;  // not above neutral, whatever is asked for
    arm.step();
    EXPECT_EQ(arm.output.override_pct, 100);
  }
}

TEST(Supervisor, HoldsWhileThereIsACauseAndAHalfSecondMore) {
  const struct {
    void (*spoil)(Supervisor::Input&);
    Reason reason;
    bool enable;
    int held_steps = 2000;
  } cases[] = {
      {[](auto& i) { i.inhibit = true; }, Reason::kInhibited, false},
      {[](auto& i) { i.threading = true; }, Reason::kThreading, false},
      {[](auto& i) { i.reversed = true; }, Reason::kThreading, false},
      {[](auto& i) { i.spindle_at_speed = false; }, Reason::kSpindle, true},
      {[](auto& i) { i.missed_ticks = 3; }, Reason::kOverrun, true, 0},
  };
  for (const auto& c : cases) {
    auto bench = bench_in(S::kControl);
    const auto sound = bench.input;
    c.spoil(bench.input);
    bench.input.override_pct = 90;
    EXPECT_EQ(bench.step(), S::kHold);
    EXPECT_EQ(bench.output.reason, c.reason);
    EXPECT_EQ(bench.output.override_pct, 80);
    EXPECT_EQ(bench.output.permission.enable, c.enable);
    EXPECT_FALSE(bench.output.permission.may_rise);
    EXPECT_EQ(bench.output.permission.ceiling_pct, 80.0F);
    bench.step(c.held_steps);
    EXPECT_EQ(bench.output.state, S::kHold);
    bench.input = sound;
    bench.input.override_pct = 90;
    EXPECT_EQ(bench.step(499), S::kHold);
    EXPECT_EQ(bench.output.override_pct, 80);
    EXPECT_EQ(bench.step(), S::kControl);
    EXPECT_EQ(bench.output.override_pct, 80);
    bench.step();
    EXPECT_EQ(bench.output.override_pct, 90);
  }
}

// While the CNC forbids control nothing but 100 % goes out, but from below it is not raised.
TEST(Supervisor, FallsToNeutralInATappingCycle) {
  auto bench = bench_in(S::kControl);
  bench.input.override_pct = 140;
  bench.step();
  EXPECT_EQ(bench.output.override_pct, 140);
  bench.input.threading = true;
  bench.step();
  EXPECT_EQ(bench.output.override_pct, 100);
  bench.input.override_pct = 30;  // what the controller makes of the torque of a tap is no force
  bench.step(100);
  EXPECT_EQ(bench.output.override_pct, 100);
}

TEST(Supervisor, NeverLeavesDead) {
  for (unsigned k = 0; k < kSupervisorStateCount; ++k) {
    auto bench = bench_in(static_cast<S>(k));
    const int before = k == 0 ? 100 : bench.output.override_pct;
    bench.input.stop = true;
    EXPECT_EQ(bench.step(), S::kDead) << k;
    EXPECT_TRUE(bench.output.silent && !bench.output.alive && bench.output.reason != Reason::kNone);
    EXPECT_LE(bench.output.override_pct, before);
    std::mt19937 random(k);
    for (int i = 0; i < 1000; ++i) {
      bench.input = sound_input();
      bench.input.arm = random() % 2 == 0;
      bench.input.control = random() % 2 == 0;
      bench.input.reset = random() % 2 == 0;
      ASSERT_EQ(bench.step(), S::kDead);
    }
  }
}

TEST(Supervisor, GoesBackToCheckFromReadyAlone) {
  for (const S state : {S::kReady, S::kMonitor, S::kControl}) {
    auto bench = bench_in(state);
    bench.input.checks_passed = false;
    EXPECT_EQ(bench.step(), state == S::kReady ? S::kCheck : state);
  }
}

TEST(Supervisor, RefusesEveryConfigThatBreaksARule) {
  using Config = Supervisor::Config;
  using Error = Supervisor::ConfigError;
  const struct {
    void (*spoil)(Config&);
    Error error;
  } cases[] = {
      {[](Config& c) { c.period_s = 0.0F; }, Error::kPeriod},
      {[](Config& c) { c.period_s = kNan; }, Error::kPeriod},
      {[](Config& c) { c.period_s = 11.0F; }, Error::kPeriod},
      {[](Config& c) { c.link_timeout_s = 0.0F; }, Error::kTime},
      {[](Config& c) { c.link_timeout_s = kInfinity; }, Error::kTime},
      {[](Config& c) { c.samples_timeout_s = kNan; }, Error::kTime},
      {[](Config& c) { c.estimate_timeout_s = -1.0F; }, Error::kTime},
      {[](Config& c) { c.overrun_window_s = 0.0F; }, Error::kTime},
      {[](Config& c) { c.overrun_ratio = 0.0F; }, Error::kTime},
      {[](Config& c) { c.overrun_ratio = kNan; }, Error::kTime},
      {[](Config& c) { c.neutral_pct = 255.0F; }, Error::kOverride},
      {[](Config& c) { c.fallback_pct = -1.0F; }, Error::kOverride},
      {[](Config& c) { c.hold_pct = kNan; }, Error::kOverride},
      {[](Config& c) { c.fall_pct_s = 0.0F; }, Error::kFall},
      {[](Config& c) { c.fall_pct_s = kNan; }, Error::kFall},
      {[](Config& c) { c.hold_release_s = 0.0F; }, Error::kRelease},
      {[](Config& c) { c.hold_release_s = kNan; }, Error::kRelease},
  };
  for (const auto& c : cases) {
    Config config = kSupervised;
    c.spoil(config);
    EXPECT_EQ(config.check().error(), c.error);
    EXPECT_FALSE(Supervisor::make(config));
  }
}

}  // namespace
}  // namespace cutforce::control
