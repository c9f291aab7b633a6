#include "estimator/synthesized_monitor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>

#include "support/allocation_count.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::SynthesizedMonitor;

constexpr SynthesizedMonitor::Config kPaper{.period_s = 0.05F,
                                            .mode = SynthesizedMonitor::Mode::kAbsolute,
                                            .threshold_ratio = 0.08F,
                                            .hold_s = 0.2F,
                                            .compensation_ratio = 0.97F,
                                            .power_floor_w = 100.0F};
static_assert(kPaper.check());

SynthesizedMonitor::Output at(SynthesizedMonitor& monitor, float computed_w, float measured_w) {
  return monitor.step({.computed_power_w = computed_w,
                       .measured_power_w = measured_w,
                       .computed_torque_nm = 10.0F,
                       .measured_torque_nm = 5.0F});
}

TEST(SynthesizedMonitor, HoldsTheComputedEstimateForFourWindowsAfterTheLastExcess) {
  auto monitor = SynthesizedMonitor::make(kPaper).value();
  EXPECT_FALSE(at(monitor, 1000.0F, 1000.0F).computed);
  EXPECT_TRUE(at(monitor, 1100.0F, 1000.0F).computed);
  EXPECT_TRUE(at(monitor, 1100.0F, 1000.0F).computed);
  for (int k = 0; k < 4; ++k) {
    const auto output = at(monitor, 1070.0F, 1000.0F);
    EXPECT_TRUE(output.computed);
    EXPECT_NEAR(output.torque_nm, 9.7F, 1e-5F);
  }
  const auto after = at(monitor, 1070.0F, 1000.0F);
  EXPECT_FALSE(after.computed);
  EXPECT_EQ(after.torque_nm, 5.0F);
}

// The end of a cut: power falls, the slow meter still stands high.
TEST(SynthesizedMonitor, SeesTheEndOfACutInTheAbsoluteFormOnly) {
  auto config = kPaper;
  auto absolute = SynthesizedMonitor::make(config).value();
  EXPECT_TRUE(at(absolute, 100.0F, 1000.0F).computed);
  config.mode = SynthesizedMonitor::Mode::kPositiveOnly;
  auto positive = SynthesizedMonitor::make(config).value();
  EXPECT_FALSE(at(positive, 100.0F, 1000.0F).computed);
  EXPECT_TRUE(at(positive, 1100.0F, 1000.0F).computed);
}

TEST(SynthesizedMonitor, DividesByNothingBelowTheFloor) {
  auto monitor = SynthesizedMonitor::make(kPaper).value();
  EXPECT_FALSE(at(monitor, 7.0F, 0.0F).computed);
  EXPECT_NEAR(at(monitor, 7.0F, 0.0F).power_ratio, 0.07F, 1e-6F);
  // A drive that regenerates, both powers alike.
  EXPECT_FALSE(at(monitor, -1000.0F, -1000.0F).computed);
  EXPECT_NEAR(at(monitor, -1100.0F, -1000.0F).power_ratio, -0.1F, 1e-6F);
}

TEST(SynthesizedMonitor, RefusesWhatItCannotWorkWith) {
  using Error = SynthesizedMonitor::ConfigError;
  const auto refused = [](auto change) {
    auto config = kPaper;
    change(config);
    const auto made = SynthesizedMonitor::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.period_s = 0.0F; }), Error::kPeriod);
  EXPECT_EQ(refused([](auto& c) { c.threshold_ratio = NAN; }), Error::kThreshold);
  EXPECT_EQ(refused([](auto& c) { c.hold_s = -0.1F; }), Error::kHold);
  EXPECT_EQ(refused([](auto& c) { c.compensation_ratio = 0.0F; }), Error::kCompensation);
  EXPECT_EQ(refused([](auto& c) { c.power_floor_w = 0.0F; }), Error::kFloor);
}

// Whatever the powers, the output is one of the two estimates, and it resumes from a snapshot.
TEST(SynthesizedMonitor, ChoosesOneOfTwoAndContinuesFromASnapshotWithoutAllocating) {
  std::mt19937 random(8);
  std::uniform_real_distribution<float> draw(-2000.0F, 2000.0F);
  auto original = SynthesizedMonitor::make(kPaper).value();
  auto resumed = original;
  const auto allocations = allocation_count();
  for (int k = 0; k < 2000; ++k) {
    const float computed_w = draw(random);
    const float measured_w = k % 2 == 0 ? computed_w : draw(random);
    resumed.restore(original.state());
    const auto a = at(original, computed_w, measured_w);
    EXPECT_EQ(a.torque_nm, a.computed ? 0.97F * 10.0F : 5.0F);
    EXPECT_EQ(at(resumed, computed_w, measured_w).torque_nm, a.torque_nm);
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
