#include "control/fuzzy.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <tuple>
#include <vector>

#include "support/allocation_count.hpp"
#include "support/cutting_plant.hpp"
#include "support/end_mill.hpp"
#include "support/same_bits.hpp"

namespace cutforce::control {
namespace {

using host_tests::CuttingPlant;
using host_tests::StepResponse;

constexpr FuzzyPi::Config kLathe{
    .period_s = 0.05F, .error_range_n = 250.0F, .change_range_n = 250.0F, .step_range_pct = 12.0F};
static_assert(kLathe.check());

constexpr LawInput active(float force_n, float applied_pct) {
  return {.force_reference_n = 500.0F,
          .force_n = force_n,
          .force_sigma_n = 5.0F,
          .override_applied_pct = applied_pct,
          .override_tolerance_pct = 0.5F,
          .spindle_ratio = 1.0F,
          .phase = CutPhase::kCut,
          .mode = LawMode::kActive,
          .part_start = false};
}

// The table of P3 as the project's sheet prints it: rows e, columns de, NB to PB.
constexpr int kTable[7][7] = {{-3, -3, -3, -3, -2, -1, 0}, {-3, -3, -3, -2, -1, 0, 1},
                              {-3, -3, -2, -1, 0, 1, 2},   {-3, -2, -1, 0, 1, 2, 3},
                              {-2, -1, 0, 1, 2, 3, 3},     {-1, 0, 1, 2, 3, 3, 3},
                              {0, 1, 2, 3, 3, 3, 3}};

// Mamdani's inference by its definition: all 49 rules, the union sampled.
double by_definition(double error_n, double change_n, int samples) {
  const auto triangle = [](double at, int label) {
    return std::max(0.0, 1.0 - std::abs(at - static_cast<double>(label)));
  };
  const double e = std::clamp(3.0 * error_n / 250.0, -3.0, 3.0);
  const double d = std::clamp(3.0 * change_n / 250.0, -3.0, 3.0);
  double strength[7] = {};
  for (int a = -3; a <= 3; ++a) {
    for (int b = -3; b <= 3; ++b) {
      double& strongest = strength[kTable[a + 3][b + 3] + 3];
      strongest = std::max(strongest, std::min(triangle(e, a), triangle(d, b)));
    }
  }
  double area = 0.0;
  double moment = 0.0;
  for (int i = 0; i < samples; ++i) {
    const double at = -4.0 + 8.0 * (i + 0.5) / samples;
    double height = 0.0;
    for (int set = -3; set <= 3; ++set)
      height = std::max(height, std::min(strength[set + 3], triangle(at, set)));
    area += height;
    moment += height * at;
  }
  return 4.0 * moment / area;  // 12 % are three labels
}

TEST(FuzzyPi, AnswersEveryPairOfLabelsAsTheTableSays) {
  const auto law = FuzzyPi::make(kLathe).value();
  for (int a = -3; a <= 3; ++a) {
    for (int b = -3; b <= 3; ++b) {
      const float step_pct = law.step_pct(static_cast<float>(a) * 250.0F / 3.0F,
                                          static_cast<float>(b) * 250.0F / 3.0F);
      EXPECT_NEAR(step_pct, 4.0F * static_cast<float>(kTable[a + 3][b + 3]), 1e-4F)
          << a << " " << b;
    }
  }
  // Beyond the ranges nothing more is added.
  EXPECT_NEAR(law.step_pct(1e6F, 1e6F), 12.0F, 1e-5F);
  EXPECT_NEAR(law.step_pct(-300.0F, 1e6F), 0.0F, 1e-5F);
}

TEST(FuzzyPi, HasTheCentroidOfTheUnionExactly) {
  const auto law = FuzzyPi::make(kLathe).value();
  std::mt19937 random(1);
  std::uniform_real_distribution<float> force_n(-300.0F, 300.0F);
  for (int i = 0; i < 1000; ++i) {
    const float error_n = force_n(random);
    const float change_n = force_n(random);
    EXPECT_NEAR(static_cast<double>(law.step_pct(error_n, change_n)),
                by_definition(static_cast<double>(error_n), static_cast<double>(change_n), 40'000),
                1e-5)
        << error_n << " " << change_n;
  }
}

TEST(FuzzyPi, IsOddToTheBitAndWithinItsRange) {
  const auto law = FuzzyPi::make(kLathe).value();
  std::mt19937 random(2);
  std::uniform_real_distribution<float> force_n(-400.0F, 400.0F);
  for (int i = 0; i < 200'000; ++i) {
    const float error_n = i % 5 == 0 ? 0.0F : force_n(random);
    const float change_n = i % 7 == 0 ? 0.0F : force_n(random);
    const float step_pct = law.step_pct(error_n, change_n);
    ASSERT_EQ(law.step_pct(-error_n, -change_n), -step_pct);
    ASSERT_LE(std::abs(step_pct), 12.0001F);
  }
  EXPECT_EQ(law.step_pct(0.0F, 0.0F), 0.0F);
}

// Small changes of force make small changes of the step: no jump between rules.
TEST(FuzzyPi, IsContinuous) {
  const auto law = FuzzyPi::make(kLathe).value();
  std::mt19937 random(3);
  std::uniform_real_distribution<float> force_n(-260.0F, 260.0F);
  for (int i = 0; i < 100'000; ++i) {
    const float error_n = force_n(random);
    const float change_n = force_n(random);
    const float step_pct = law.step_pct(error_n, change_n);
    ASSERT_NEAR(law.step_pct(error_n + 0.1F, change_n), step_pct, 0.02F);
    ASSERT_NEAR(law.step_pct(error_n, change_n + 0.1F), step_pct, 0.02F);
  }
}

// The reproduction lathe with an exact force: the step from 1 to 1.5 mm, codes of 1 %.
TEST(FuzzyPi, SettlesOnTheReproductionLathe) {
  auto law = FuzzyPi::make(kLathe).value();
  CuttingPlant plant({.period_s = 0.05,
                      .time_constant_s = 0.1,
                      .force_n = 400.0,
                      .feed_exponent = 1.0,
                      .latency_ticks = 0,
                      .override_pct = 100.0});
  float applied_pct = 125.0F;
  std::vector<double> force_n;
  plant.set_force(500.0);
  law.restore({.wanted_pct = 125.0F, .error_n = 0.0F});
  for (int i = 0; i < 100; ++i) {
    applied_pct = std::clamp(
        std::round(law.step(active(static_cast<float>(plant.force_n()), applied_pct)).override_pct),
        20.0F, 200.0F);
    force_n.push_back(plant.step(static_cast<double>(applied_pct), 1.5));
  }
  const StepResponse found(force_n, 500.0, 0.05, 0.05);
  // The project's sheet has 28 % and 0.50 s for this plant.
  EXPECT_NEAR(found.peak_n / 500.0, 1.28, 0.01);
  EXPECT_NEAR(found.settled_s, 0.50, 0.01);
  EXPECT_NEAR(found.last_n, 500.0, 3.0);
}

TEST(FuzzyPi, DoesNotWindUpAgainstALimit) {
  auto law = FuzzyPi::make(kLathe).value();
  for (int i = 0; i < 1200; ++i) std::ignore = law.step(active(100.0F, 200.0F));
  EXPECT_LT(law.step(active(520.0F, 200.0F)).override_pct, 200.0F);
  for (int i = 0; i < 1200; ++i) std::ignore = law.step(active(1500.0F, 20.0F));
  EXPECT_GT(law.step(active(450.0F, 20.0F)).override_pct, 20.0F);
}

TEST(FuzzyPi, TakesOverWithoutAJumpFromWhateverWasApplied) {
  for (const float applied_pct : {20.0F, 73.0F, 200.0F}) {
    for (const LawMode mode : {LawMode::kTrack, LawMode::kHold}) {
      auto law = FuzzyPi::make(kLathe).value();
      auto input = active(500.0F, applied_pct);
      for (int i = 0; i < 3; ++i) {
        input.mode = mode;
        EXPECT_EQ(law.step(input).override_pct, applied_pct);
      }
      input.mode = LawMode::kActive;
      EXPECT_NEAR(law.step(input).override_pct, applied_pct, 0.51F);
    }
  }
}

TEST(FuzzyPi, RefusesEveryConfigThatBreaksARule) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  using Config = FuzzyPi::Config;
  using Error = FuzzyPi::ConfigError;
  const struct {
    void (*spoil)(Config&);
    Error error;
  } cases[] = {
      {[](Config& c) { c.period_s = 0.0F; }, Error::kPeriod},
      {[](Config& c) { c.period_s = kNan; }, Error::kPeriod},
      {[](Config& c) { c.error_range_n = 0.0F; }, Error::kRange},
      {[](Config& c) { c.error_range_n = -250.0F; }, Error::kRange},
      {[](Config& c) { c.error_range_n = kNan; }, Error::kRange},
      {[](Config& c) { c.change_range_n = 0.0F; }, Error::kRange},
      {[](Config& c) { c.change_range_n = kNan; }, Error::kRange},
      {[](Config& c) { c.change_range_n = 1e9F; }, Error::kRange},
      {[](Config& c) { c.step_range_pct = 0.0F; }, Error::kStep},
      {[](Config& c) { c.step_range_pct = -12.0F; }, Error::kStep},
      {[](Config& c) { c.step_range_pct = kNan; }, Error::kStep},
      {[](Config& c) { c.step_range_pct = 300.0F; }, Error::kStep},
  };
  for (const auto& c : cases) {
    Config config = kLathe;
    c.spoil(config);
    EXPECT_EQ(config.check().error(), c.error);
    EXPECT_FALSE(FuzzyPi::make(config));
  }
}

TEST(FuzzyPi, StaysFiniteAndContinuesBitExactlyWithoutAllocating) {
  std::mt19937 random(5);
  auto law = FuzzyPi::make(kLathe).value();
  auto resumed = law;
  const auto allocations = host_tests::allocation_count();
  for (int i = 0; i < 200'000; ++i) {
    auto input = active(static_cast<float>(random() % (i % 2 == 0 ? 1'000'000U : 1'000U)),
                        static_cast<float>(random() % 255));
    input.mode = static_cast<LawMode>(random() % 3);
    resumed.restore(law.state());
    const auto answer = law.step(input);
    // Never farther from what acted than rounding and one step.
    ASSERT_LE(std::abs(answer.override_pct - input.override_applied_pct), 12.51F) << i;
    if (input.mode != LawMode::kActive) {
      ASSERT_EQ(answer.override_pct, input.override_applied_pct);
    }
    ASSERT_TRUE(host_tests::same_bits(resumed.step(input), answer));
    ASSERT_TRUE(host_tests::same_bits(resumed.state(), law.state()));
  }
  EXPECT_EQ(host_tests::allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::control
