// What the supervisor and the CNC's job allow, on its way to the byte: control_path.hpp and
// feed_override.hpp with a permission, and the control loop that is given one.
#include "control/permission.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <tuple>

#include "control/control_path.hpp"
#include "firmware/configuration.hpp"
#include "firmware/configuration_supervisor.hpp"
#include "firmware/machine_check.hpp"
#include "support/allocation_count.hpp"
#include "support/cutting_plant.hpp"
#include "support/random_float.hpp"

namespace cutforce::control {
namespace {

using host_tests::CuttingPlant;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

firmware::Machine lathe() {
  auto machine = firmware::default_machine();
  machine.estimator = firmware::EstimatorName::kDynamometer;
  machine.controller = firmware::ControllerName::kPi;
  machine.sample_rate_hz = 20.0F;
  machine.slew_up_pct_s = 400.0F;
  machine.slew_down_pct_s = 200.0F;  // 10 % a tick
  return machine;
}

ControlPath::Config path_config() { return firmware::make_loop_config(lathe()).value().controller; }

constexpr CuttingPlant::Config kProcess{.period_s = 0.05,
                                        .time_constant_s = 0.1,
                                        .force_n = 400.0,
                                        .feed_exponent = 1.0,
                                        .latency_ticks = 1,
                                        .override_pct = 100.0};

// The loop and the machine, one tick at a time.
struct Cut {
  ControlPath path = ControlPath::make(path_config()).value();
  CuttingPlant plant{kProcess};
  Permission permission = kEverything;
  ControlPath::Output output{};
  std::uint64_t allocations = 0;  // of the path alone

  int tick(double depth_mm = 1.0) {
    const auto allocated = host_tests::allocation_count();
    output = path.step({.force_n = static_cast<float>(plant.force_n()),
                        .force_sigma_n = 5.0F,
                        .force_age_ticks = 0,
                        .override_reported_pct = 0.0F,
                        .spindle_ratio = 1.0F,
                        .force_valid = true,
                        .override_reported = false,
                        .permission = permission,
                        .part_start = false});
    allocations += host_tests::allocation_count() - allocated;
    plant.step(output.override_pct, depth_mm);
    return output.override_pct;
  }
  int settle(double depth_mm = 1.0) {
    for (int i = 0; i < 200; ++i) tick(depth_mm);
    return output.override_pct;
  }
};

TEST(Permission, DoesNotLetTheOverrideRiseWhateverTheLawSays) {
  Cut cut;
  ASSERT_EQ(cut.settle(2.0), 62);  // 500 N where 100 % gives 800 N; a half goes down
  cut.permission.may_rise = false;
  int before = cut.output.override_pct;
  for (int i = 0; i < 400; ++i) {
    const int now = cut.tick(i < 200 ? 1.0 : 3.0);
    ASSERT_LE(now, before);
    before = now;
    if (i == 199) {
      EXPECT_EQ(now, 62);
    }
  }
  EXPECT_LT(before, 50);  // it still falls for a deeper cut
}

// Nor does it go back to neutral.
TEST(Permission, StaysWhereItIsWithoutControllerAndWithoutRise) {
  Cut cut;
  ASSERT_EQ(cut.settle(2.0), 62);
  cut.permission.enable = cut.permission.may_rise = false;
  for (int i = 0; i < 100; ++i) EXPECT_EQ(cut.tick(2.0), 62);
  EXPECT_FALSE(cut.output.controlling);
  cut.permission.may_rise = true;
  EXPECT_EQ(cut.tick(2.0), 82);
  EXPECT_EQ(cut.tick(2.0), 100);
}

TEST(Permission, ComesDownToANewCeilingAtTheSlewRate) {
  Cut cut;
  ASSERT_EQ(cut.settle(), 125);
  cut.permission.ceiling_pct = 90.7F;
  EXPECT_EQ(cut.tick(), 115);
  EXPECT_EQ(cut.tick(), 105);
  EXPECT_EQ(cut.tick(), 95);
  EXPECT_EQ(cut.tick(), 90);
  EXPECT_EQ(cut.settle(), 90);
  EXPECT_TRUE(cut.output.saturated_high);
  cut.permission.ceiling_pct = -3.0F;  // below the configured range: its lower end
  EXPECT_EQ(cut.settle(), 20);
  cut.permission.ceiling_pct = 254.0F;
  EXPECT_EQ(cut.settle(), 125);
}

TEST(Permission, RaisesAFloorOnlyWhereItMayRiseAndNeverOverTheCeiling) {
  Cut cut;
  ASSERT_EQ(cut.settle(2.0), 62);
  cut.permission.floor_pct = 79.5F;
  cut.permission.may_rise = false;
  EXPECT_EQ(cut.settle(2.0), 62);
  cut.permission.may_rise = true;
  EXPECT_EQ(cut.settle(2.0), 80);
  EXPECT_TRUE(cut.output.saturated_low);
  cut.permission.ceiling_pct = 70.0F;
  EXPECT_EQ(cut.settle(2.0), 70);
  cut.permission = kEverything;
  EXPECT_EQ(cut.settle(2.0), 62);
}

TEST(Permission, HoldsTheForceThatItNames) {
  Cut cut;
  ASSERT_EQ(cut.settle(), 125);
  cut.permission.force_reference_n = 320.0F;
  EXPECT_EQ(cut.settle(), 80);
  cut.permission.force_reference_n = 0.0F;
  EXPECT_EQ(cut.settle(), 125);
  for (const float none_n : {-5.0F, kNan}) {
    cut.permission.force_reference_n = none_n;
    EXPECT_EQ(cut.settle(), 125);
  }
  // As far as any force of this machine: beside it this cut is air, which has the approach value.
  cut.permission.force_reference_n = kInfinity;
  EXPECT_EQ(cut.settle(), 100);
}

// The bounds that hold whatever bits a permission has.
TEST(Permission, NeverWidensWhatIsConfiguredUnderRandomBits) {
  std::mt19937 random(12);
  Cut cut;
  auto resumed = cut.path;
  int before = 100;
  for (int i = 0; i < 300'000; ++i) {
    auto& p = cut.permission;
    if (random() % 20 == 0) {
      p.enable = random() % 4 != 0;
      p.may_rise = random() % 2 != 0;
      p.ceiling_pct =
          random() % 2 == 0 ? host_tests::any_float(random) : static_cast<float>(random() % 255);
      p.floor_pct =
          random() % 2 == 0 ? host_tests::any_float(random) : static_cast<float>(random() % 255);
      p.force_reference_n =
          random() % 2 == 0 ? host_tests::any_float(random) : static_cast<float>(random() % 2000);
    }
    resumed.restore(cut.path.state());
    const int now = cut.tick(0.1 * static_cast<double>(i / 1000 % 40));
    ASSERT_TRUE(now >= 20 && now <= 200) << i;
    ASSERT_TRUE(std::isfinite(cut.output.wanted_pct)) << i;
    if (!p.may_rise || p.ceiling_pct != p.ceiling_pct) {
      ASSERT_LE(now, before) << i;
    }
    if (p.ceiling_pct >= 20.0F && static_cast<float>(before) <= p.ceiling_pct) {
      ASSERT_LE(static_cast<float>(now), p.ceiling_pct) << i;
    }
    ASSERT_GE(now, before - 11) << i;  // 10 % a tick, and the rounding
    before = now;
  }
  EXPECT_EQ(cut.allocations, 0U);
}

TEST(Permission, OfEverythingChangesNothingInTheRange) {
  auto with = FeedOverride::make(path_config().feed_override).value();
  auto without = with;
  std::mt19937 random(5);
  for (int i = 0; i < 100'000; ++i) {
    const float wanted_pct = static_cast<float>(random() % 3000) / 10.0F;
    std::ignore = with.step({.wanted_pct = wanted_pct,
                             .may_rise = true,
                             .ceiling_pct = kEverything.ceiling_pct,
                             .floor_pct = kEverything.floor_pct});
    std::ignore = without.step({.wanted_pct = wanted_pct, .may_rise = true});
    ASSERT_EQ(std::memcmp(&with.state(), &without.state(), sizeof(FeedOverride::State)), 0);
  }
}

// In steps of 10 % the ceiling moves inward to one.
TEST(Permission, NarrowsInWholeSteps) {
  auto config = path_config().feed_override;
  config.step_pct = 10;
  config.hysteresis_pct = 1.0F;
  auto override = FeedOverride::make(config).value();
  const auto settle = [&override](float wanted_pct, float ceiling_pct, float floor_pct) {
    int sent = 0;
    for (int i = 0; i < 50; ++i) {
      sent = override
                 .step({.wanted_pct = wanted_pct,
                        .may_rise = true,
                        .ceiling_pct = ceiling_pct,
                        .floor_pct = floor_pct})
                 .override_pct;
    }
    return sent;
  };
  EXPECT_EQ(settle(200.0F, 89.9F, 0.0F), 80);
  EXPECT_EQ(settle(20.0F, 254.0F, 41.0F), 50);
  EXPECT_EQ(settle(20.0F, 44.0F, 41.0F), 40);
  EXPECT_EQ(settle(200.0F, 254.0F, 0.0F), 200);
}

hal::Sample force_sample(int tick, double force_n) {
  hal::Sample sample{};
  sample.time_ns = tick * std::int64_t{50'000'000};
  sample.measured_force_n = static_cast<float>(force_n);
  sample.present = hal::bit(hal::Signal::kMeasuredForce);
  return sample;
}

firmware::ControlLoop force_loop() {
  return firmware::ControlLoop::make(firmware::make_loop_config(lathe()).value()).value();
}

TEST(Permission, StaysInTheControlLoopAndInItsState) {
  auto loop = force_loop();
  CuttingPlant plant(kProcess);
  int tick = 0;
  const auto run = [&](firmware::ControlLoop& of, int ticks) {
    for (int i = 0; i < ticks; ++i) {
      std::ignore = of.step(force_sample(tick++, plant.force_n()));
      plant.step(of.command().override_pct, 1.0);
    }
    return static_cast<int>(of.command().override_pct);
  };
  EXPECT_EQ(run(loop, 200), 125);
  EXPECT_TRUE(loop.command().controlling);
  auto narrowed = kEverything;
  narrowed.ceiling_pct = 60.0F;
  loop.permit(narrowed);
  EXPECT_EQ(run(loop, 200), 60);
  auto resumed = force_loop();
  resumed.restore(loop.state());
  EXPECT_EQ(run(resumed, 200), 60);
  auto off = kEverything;
  off.enable = false;
  resumed.permit(off);
  EXPECT_EQ(run(resumed, 200), 100);
  EXPECT_FALSE(resumed.command().controlling);
}

// Whatever passes the check of the machine file makes a supervisor.
TEST(Permission, MakesASupervisorOfWhateverMachinePasses) {
  std::mt19937 random(2);
  const auto defaults = firmware::make_supervisor_config(firmware::default_machine());
  EXPECT_EQ(defaults.mode, SupervisorMode::kAdvise);
  EXPECT_EQ(defaults.link_timeout_s, 0.25F);
  EXPECT_EQ(defaults.period_s, 0.001F);
  int made = 0;
  for (int run = 0; run < 20'000; ++run) {
    auto machine = firmware::default_machine();
    for (int k = 0; k < 3; ++k) {
      const auto& parameter = firmware::kParameters[random() % firmware::kParameters.size()];
      if (parameter.section < firmware::Section::kEstimator) continue;
      const float value = parameter.minimum + (parameter.maximum - parameter.minimum) * 1e-3F *
                                                  static_cast<float>(random() % 1001);
      if (parameter.allows(value)) parameter.set(machine, 0, value);
    }
    if (!firmware::check(machine)) continue;
    ++made;
    ASSERT_TRUE(Supervisor::make(firmware::make_supervisor_config(machine)));
  }
  EXPECT_GT(made, 1000);
}

TEST(Permission, RefusesASupervisorThatCannotControlWithItsMachine) {
  auto machine = firmware::default_machine();
  machine.supervisor_mode = firmware::SupervisorMode::kControl;
  ASSERT_TRUE(firmware::check(machine));
  const struct {
    void (*spoil)(firmware::Machine&);
    std::string_view key;
  } cases[] = {
      {[](auto& m) { m.fallback_pct = 110.0F; }, "fallback_pct"},
      {[](auto& m) { m.hold_pct = 80.0F; }, "hold_pct"},
      {[](auto& m) { m.hold_release_s = 0.09F; }, "hold_release_s"},
      {[](auto& m) { m.estimate_timeout_s = 0.09F; }, "estimate_timeout_s"},
      {[](auto& m) { m.link_timeout_s = 0.01F; }, "link_timeout_s"},
      {[](auto& m) { m.overrun_ratio = kNan; }, "overrun_ratio"},
  };
  for (const auto& c : cases) {
    auto spoilt = machine;
    c.spoil(spoilt);
    EXPECT_EQ(firmware::check(spoilt).error(), c.key);
  }
}

}  // namespace
}  // namespace cutforce::control
