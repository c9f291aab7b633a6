#include "control/cut_state.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>
#include <tuple>
#include <vector>

#include "support/allocation_count.hpp"

namespace cutforce::control {
namespace {

constexpr CutState::Config kLathe{
    .period_s = 0.05F,
    .on_ratio = 0.13F,
    .off_ratio = 0.10F,
    .entry_s = 0.15F,
    .lost_s = 0.5F,
    .drop_ratio = 0.1F,
};
static_assert(kLathe.check());

constexpr CutState::Input at(float force_n) {
  return {.force_n = force_n, .force_reference_n = 500.0F, .fresh = true};
}

CutState cutting(float force_n) {
  auto cut = CutState::make(kLathe).value();
  for (int i = 0; i < 10; ++i) std::ignore = cut.step(at(force_n));
  return cut;
}

// on at 65 N, off at 50 N.
TEST(CutState, EntersAboveTheUpperThresholdOnly) {
  auto cut = CutState::make(kLathe).value();
  for (const float force_n : {0.0F, 40.0F, 60.0F, 65.0F}) {
    EXPECT_EQ(cut.step(at(force_n)).phase, CutPhase::kAir) << force_n;
  }
  EXPECT_EQ(cut.step(at(66.0F)).phase, CutPhase::kEntry);
  EXPECT_EQ(cut.step(at(55.0F)).phase, CutPhase::kEntry);
  EXPECT_EQ(cut.step(at(55.0F)).phase, CutPhase::kEntry);
  EXPECT_EQ(cut.step(at(55.0F)).phase, CutPhase::kCut);
}

TEST(CutState, BelievesTheEndOfACutAfterTheLostTimeAndNotEarlier) {
  auto cut = cutting(400.0F);
  EXPECT_EQ(cut.step(at(10.0F)).phase, CutPhase::kExit);
  for (int i = 1; i < 10; ++i) EXPECT_EQ(cut.step(at(10.0F)).phase, CutPhase::kExit) << i;
  EXPECT_EQ(cut.step(at(10.0F)).phase, CutPhase::kAir);  // 0.5 s after the first
}

TEST(CutState, ReturnsToTheCutAfterAGapWithoutANewEntry) {
  auto cut = cutting(400.0F);
  for (int i = 0; i < 5; ++i) std::ignore = cut.step(at(0.0F));
  EXPECT_EQ(cut.step(at(400.0F)).phase, CutPhase::kCut);
}

TEST(CutState, TakesALightCutForACutInTheEnd) {
  auto cut = cutting(400.0F);
  std::ignore = cut.step(at(40.0F));
  CutState::Output output{};
  for (int i = 0; i < 10; ++i) output = cut.step(at(57.0F));
  EXPECT_EQ(output.phase, CutPhase::kCut);
}

TEST(CutState, NamesASteepFallInTheCutOnly) {
  auto cut = cutting(400.0F);
  EXPECT_FALSE(cut.step(at(361.0F)).falling);
  EXPECT_TRUE(cut.step(at(320.0F)).falling);
  EXPECT_FALSE(cut.step(at(320.0F)).falling);
  EXPECT_TRUE(cut.step(at(0.0F)).falling);
  auto config = kLathe;
  config.drop_ratio = 1.0F;
  auto literal = CutState::make(config).value();
  for (int i = 0; i < 10; ++i) std::ignore = literal.step(at(400.0F));
  EXPECT_FALSE(literal.step(at(0.0F)).falling);
  auto air = CutState::make(kLathe).value();
  std::ignore = air.step(at(64.0F));
  EXPECT_FALSE(air.step(at(0.0F)).falling);
}

TEST(CutState, StandsStillWhileTheForceIsNotNew) {
  auto cut = cutting(400.0F);
  std::ignore = cut.step(at(10.0F));
  for (int i = 0; i < 100; ++i) {
    const auto output = cut.step({.force_n = 10.0F, .force_reference_n = 500.0F, .fresh = false});
    EXPECT_EQ(output.phase, CutPhase::kExit);
    EXPECT_FALSE(output.falling);
  }
}

// Whole ticks must not be lost to rounding, for any period a machine may have.
TEST(CutState, NeverBelievesTheEndOfACutTooEarlyForAnyPeriod) {
  for (const float period_s : {0.01F, 0.02F, 0.03F, 0.05F, 0.07F, 0.1F}) {
    auto config = kLathe;
    config.period_s = period_s;
    auto cut = CutState::make(config).value();
    for (int i = 0; i < 100; ++i) std::ignore = cut.step(at(400.0F));
    int ticks = 0;
    std::ignore = cut.step(at(0.0F));
    while (cut.state().phase == CutPhase::kExit) {
      std::ignore = cut.step(at(0.0F));
      ++ticks;
    }
    EXPECT_GE(static_cast<float>(ticks) * period_s, 0.4999F) << period_s;
    EXPECT_LT(static_cast<float>(ticks - 1) * period_s, 0.5F) << period_s;
  }
}

TEST(CutState, RefusesEveryConfigThatBreaksARule) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  using Config = CutState::Config;
  using Error = CutState::ConfigError;
  const struct {
    void (*spoil)(Config&);
    Error error;
  } cases[] = {
      {[](Config& c) { c.period_s = 0.0F; }, Error::kPeriod},
      {[](Config& c) { c.period_s = kNan; }, Error::kPeriod},
      {[](Config& c) { c.off_ratio = c.on_ratio; }, Error::kThresholds},
      {[](Config& c) { c.off_ratio = 0.0F; }, Error::kThresholds},
      {[](Config& c) { c.on_ratio = kNan; }, Error::kThresholds},
      {[](Config& c) { c.on_ratio = 1.0F; }, Error::kThresholds},
      {[](Config& c) { c.entry_s = -0.1F; }, Error::kEntry},
      {[](Config& c) { c.entry_s = kNan; }, Error::kEntry},
      {[](Config& c) { c.lost_s = 0.0F; }, Error::kLost},
      {[](Config& c) { c.lost_s = 1e9F; }, Error::kLost},
      {[](Config& c) { c.drop_ratio = 0.0F; }, Error::kDrop},
      {[](Config& c) { c.drop_ratio = kNan; }, Error::kDrop},
  };
  for (const auto& c : cases) {
    Config config = kLathe;
    c.spoil(config);
    EXPECT_EQ(config.check().error(), c.error);
    EXPECT_FALSE(CutState::make(config));
  }
}

// Whatever the force does, air comes only from an exit that lasted, and only below `off`.
TEST(CutState, ReachesTheAirOnlyThroughALongExit) {
  std::mt19937 random(2);
  auto cut = CutState::make(kLathe).value();
  auto resumed = cut;
  int since_exit = 0;
  const auto allocations = host_tests::allocation_count();
  for (int i = 0; i < 300'000; ++i) {
    const bool quiet = i / 40 % 2 == 0;
    const auto input = at(static_cast<float>(random() % (quiet ? 62 : 700)));
    const CutPhase before = cut.state().phase;
    resumed.restore(cut.state());
    const auto output = cut.step(input);
    ASSERT_EQ(resumed.step(input).phase, output.phase);
    ASSERT_EQ(std::memcmp(&cut.state(), &resumed.state(), sizeof(CutState::State)), 0);
    since_exit = before == CutPhase::kExit ? since_exit + 1 : 0;
    if (before != CutPhase::kAir && output.phase == CutPhase::kAir) {
      ASSERT_EQ(before, CutPhase::kExit) << i;
      ASSERT_GE(since_exit, 10) << i;
      ASSERT_LT(input.force_n, 50.0F) << i;
    }
  }
  EXPECT_EQ(host_tests::allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::control
