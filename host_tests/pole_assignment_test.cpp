#include "control/pole_assignment.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <random>
#include <tuple>

#include "support/allocation_count.hpp"
#include "support/same_bits.hpp"

namespace cutforce::control {
namespace {

// P1, case I, with its units in %: 100 % are 200 mm/min.
constexpr PoleAssignment::Config kCaseOne{
    .period_s = 0.1F,
    .pole_sum = 0.15F,
    .pole_product = -0.01F,
    .estimate = {.form = ProcessGain::Form::kLiteral,
                 .literal_rate_1_pct = 0.006F,
                 .normalised_rate_ratio = 0.6F,
                 .soft_pct = 20.0F,
                 .initial_n_pct = 8.0F,
                 .least_n_pct = 0.4F,
                 .most_n_pct = 100.0F,
                 .excitation_n = 60.0F},
    .settle_s = 1.0F,
};
static_assert(kCaseOne.check());

constexpr LawInput cutting(float force_n, float applied_pct) {
  return {.force_reference_n = 800.0F,
          .force_n = force_n,
          .force_sigma_n = 0.0F,
          .override_applied_pct = applied_pct,
          .override_tolerance_pct = 0.5F,
          .spindle_ratio = 1.0F,
          .phase = CutPhase::kCut,
          .mode = LawMode::kActive,
          .part_start = false};
}

// The compiler closes the loop on F(i) = k U(i-1) with a first guess of the gain that is wrong by
// up to eight times either way.
constexpr float force_after(float gain_n_pct, int ticks) {
  auto law = *PoleAssignment::make(kCaseOne);
  float override_pct = 50.0F;
  float force_n = 0.0F;
  for (int i = 0; i < ticks; ++i) {
    force_n = gain_n_pct * override_pct;
    const float wanted_pct = law.step(cutting(force_n, override_pct)).override_pct;
    override_pct = wanted_pct < 1.0F ? 1.0F : wanted_pct > 250.0F ? 250.0F : wanted_pct;
  }
  return force_n;
}
static_assert(force_after(4.0F, 30) > 799.9F && force_after(4.0F, 30) < 800.1F);
static_assert(force_after(16.0F, 40) > 799.9F && force_after(16.0F, 40) < 800.1F);
static_assert(force_after(64.0F, 300) > 799.9F && force_after(64.0F, 300) < 800.1F);

struct Poles {
  double sum;
  double product;
};
constexpr std::array kPoles{
    Poles{0.2 - 0.05, 0.2 * -0.05},        // P1 case I
    Poles{0.1 - 0.6, 0.1 * -0.6},          // II
    Poles{0.001 - 0.001, -0.001 * 0.001},  // III
    Poles{0.8, 0.32},                      // conjugate, 0.4 +- 0.4 i
    Poles{0.3, 0.0},                       // integral control alone
};

// P1 (8) of the gains of P1 (14), in double: the poles come back.
TEST(PoleAssignment, PutsThePolesWhereTheyWereWanted) {
  for (const auto& wanted : kPoles) {
    for (const double k : {0.4, 2.2, 8.8, 57.0}) {
      const auto gains = assigned_gains(k, wanted.sum, wanted.product);
      const double half = 0.5 * (1.0 - k * gains.proportional - k * gains.integral_tick);
      const std::complex<double> root =
          std::sqrt(std::complex<double>(half * half + k * gains.proportional));
      const std::complex<double> was =
          std::sqrt(std::complex<double>(0.25 * wanted.sum * wanted.sum - wanted.product));
      EXPECT_LT(std::abs(half + root - (0.5 * wanted.sum + was)), 1e-9);
      EXPECT_LT(std::abs(half - root - (0.5 * wanted.sum - was)), 1e-9);
    }
  }
}

// Force of the linear loop late over early, gains made for 1 N/%, the plant r N/%.
double growth(const Poles& poles, double r) {
  const auto gains = assigned_gains(1.0, poles.sum, poles.product);
  double wanted = 1.0;
  double error = 0.0;
  double early = 0.0;
  double late = 0.0;
  for (int i = 0; i < 4000; ++i) {
    const double now = -r * wanted;
    wanted += gains.proportional * (now - error) + gains.integral_tick * now;
    error = now;
    if (i < 10) early = std::max(early, std::abs(now));
    if (i >= 3990) late = std::max(late, std::abs(now));
  }
  return late / early;
}

// 2.326, 1.282 and 2.000 for the three cases of P1; and for any pair the bound is sharp.
TEST(PoleAssignment, TellsHowWrongItsGainMayBe) {
  const auto margin = [](const Poles& poles) {
    auto config = kCaseOne;
    config.pole_sum = static_cast<float>(poles.sum);
    config.pole_product = static_cast<float>(poles.product);
    EXPECT_TRUE(config.check());
    auto law = PoleAssignment::make(config).value();
    return static_cast<double>(law.step(cutting(800.0F, 100.0F)).stability_margin_ratio);
  };
  EXPECT_NEAR(margin(kPoles[0]), 2.326, 5e-4);
  EXPECT_NEAR(margin(kPoles[1]), 1.282, 5e-4);
  EXPECT_NEAR(margin(kPoles[2]), 2.000, 5e-4);
  std::mt19937 random(9);
  std::uniform_real_distribution<double> unit(-0.95, 0.95);
  for (int i = 0; i < 200; ++i) {
    const double a = unit(random);
    const double b = unit(random);
    // a, b are the poles, or one pole's radius and the cosine of its angle.
    const Poles poles = i % 2 == 0 ? Poles{a + b, a * b} : Poles{2.0 * a * b, a * a};
    const double r = margin(poles);
    EXPECT_GT(r, 1.0);
    EXPECT_LT(growth(poles, 0.99 * r), 1.0) << poles.sum << ' ' << poles.product;
    EXPECT_GT(growth(poles, 1.01 * r), 1.0) << poles.sum << ' ' << poles.product;
  }
}

TEST(PoleAssignment, TakesOverWithoutAJumpAndLearnsWhileAnotherDecides) {
  auto law = PoleAssignment::make(kCaseOne).value();
  auto input = cutting(800.0F, 50.0F);  // 16 N/%, twice the first guess
  input.mode = LawMode::kTrack;
  for (int i = 0; i < 40; ++i) EXPECT_EQ(law.step(input).override_pct, 50.0F);
  EXPECT_NEAR(law.step(input).process_gain_n_pct, 16.0F, 0.01F);
  input.force_n = 5000.0F;
  input.mode = LawMode::kHold;
  EXPECT_EQ(law.step(input).override_pct, 50.0F);
  input.mode = LawMode::kTrack;
  input.phase = CutPhase::kAir;
  EXPECT_NEAR(law.step(input).process_gain_n_pct, 16.0F, 0.01F);
  input.force_n = 800.0F;
  EXPECT_EQ(law.step(input).override_pct, 50.0F);
  EXPECT_NEAR(law.step(cutting(800.0F, 50.0F)).override_pct, 50.0F, 0.51F);
}

TEST(PoleAssignment, DoesNotWindUpAgainstALimit) {
  auto law = PoleAssignment::make(kCaseOne).value();
  for (int i = 0; i < 1200; ++i) std::ignore = law.step(cutting(660.0F, 150.0F));
  EXPECT_LT(law.step(cutting(820.0F, 150.0F)).override_pct, 150.0F);
}

// Conclusion 4 of P1: a constant depth of cut, and the tool wears by 30 %.
TEST(PoleAssignment, ShowsTheWearSinceTheLastEntry) {
  auto law = PoleAssignment::make(kCaseOne).value();
  const auto run = [&law](CutPhase phase, float force_n, int ticks) {
    auto input = cutting(force_n, 100.0F);
    input.phase = phase;
    for (int i = 0; i < ticks; ++i) std::ignore = law.step(input);
    return law.wear_ratio();
  };
  EXPECT_EQ(run(CutPhase::kEntry, 500.0F, 2), 1.0F);
  EXPECT_EQ(run(CutPhase::kCut, 1000.0F, 9), 1.0F);
  EXPECT_NEAR(run(CutPhase::kCut, 1000.0F, 1), 1.0F, 1e-6F);
  EXPECT_NEAR(run(CutPhase::kCut, 1300.0F, 40), 1.3F, 1e-3F);
  EXPECT_NEAR(run(CutPhase::kExit, 0.0F, 5), 1.3F, 1e-3F);  // a gap of an interrupted cut
  EXPECT_NEAR(run(CutPhase::kCut, 1300.0F, 5), 1.3F, 1e-3F);
  EXPECT_NEAR(run(CutPhase::kAir, 0.0F, 20), 1.3F, 1e-3F);
  EXPECT_EQ(run(CutPhase::kEntry, 30.0F, 1), 1.0F);  // even where the force teaches nothing yet
}

TEST(PoleAssignment, RefusesEveryConfigThatBreaksARule) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  using Config = PoleAssignment::Config;
  using Error = PoleAssignment::ConfigError;
  const auto poles = [](Config& c, float sum, float product) {
    c.pole_sum = sum;
    c.pole_product = product;
  };
  for (const auto& [sum, product] : {std::pair{1.0F, 0.0F},  // 1 and 0
                                     {-1.0F, 0.0F},          // -1 and 0
                                     {0.0F, 1.0F},           // +-i
                                     {0.0F, -1.0F},          // +-1
                                     {1.9F, 0.85F},          // 1.2 and 0.7
                                     {-2.5F, 1.0F},          // -2 and -0.5
                                     {0.5F, 1.2F},           // conjugate, outside
                                     {2.0F, 1.0F},           // 1 twice
                                     {kNan, 0.0F},
                                     {0.0F, kNan},
                                     {kInfinity, 0.0F},
                                     {0.0F, -kInfinity}}) {
    Config config = kCaseOne;
    poles(config, sum, product);
    EXPECT_EQ(config.check().error(), Error::kPoles) << sum << ' ' << product;
    EXPECT_FALSE(PoleAssignment::make(config));
  }
  const struct {
    void (*spoil)(Config&);
    Error error;
  } cases[] = {
      {[](Config& c) { c.period_s = 0.0F; }, Error::kPeriod},
      {[](Config& c) { c.period_s = kNan; }, Error::kPeriod},
      {[](Config& c) { c.estimate.least_n_pct = -1.0F; }, Error::kEstimate},
      {[](Config& c) { c.settle_s = 0.0F; }, Error::kSettle},
      {[](Config& c) { c.settle_s = kNan; }, Error::kSettle},
      {[](Config& c) { c.settle_s = kInfinity; }, Error::kSettle},
  };
  for (const auto& c : cases) {
    Config config = kCaseOne;
    c.spoil(config);
    EXPECT_EQ(config.check().error(), c.error);
    EXPECT_FALSE(PoleAssignment::make(config));
  }
}

// The highest gains that there are, and proportional and integral part of opposite signs.
TEST(PoleAssignment, StaysFiniteBetweenTwoForcesNearTheLargestFloat) {
  auto config = kCaseOne;
  config.estimate.least_n_pct = config.estimate.initial_n_pct = 1e-4F;
  auto law = PoleAssignment::make(config).value();
  for (const float force_n : {3e38F, 1e38F, 0.0F, 2e38F}) {
    auto input = cutting(force_n, 100.0F);
    input.phase = CutPhase::kExit;  // nothing is learned
    EXPECT_TRUE(std::isfinite(law.step(input).override_pct)) << force_n;
  }
}

// Forces up to the largest float, any override, any order of modes and phases; poles of all kinds.
TEST(PoleAssignment, StaysFiniteAndFollowsAndContinuesBitExactlyWithoutAllocating) {
  std::mt19937 random(10);
  for (const auto& poles : kPoles) {
    auto config = kCaseOne;
    config.pole_sum = static_cast<float>(poles.sum);
    config.pole_product = static_cast<float>(poles.product);
    if (random() % 2 == 0) config.estimate.form = ProcessGain::Form::kNormalised;
    auto law = PoleAssignment::make(config).value();
    auto resumed = PoleAssignment::make(config).value();
    const auto allocations = host_tests::allocation_count();
    for (int i = 0; i < 100'000; ++i) {
      auto input =
          cutting(static_cast<float>(random() % 10'000), static_cast<float>(random() % 255));
      if (random() % 100 == 0) input.force_n = std::ldexp(1.0F, static_cast<int>(random() % 128));
      input.mode = static_cast<LawMode>(random() % 3);
      input.phase = static_cast<CutPhase>(random() % 4);
      resumed.restore(law.state());
      const auto output = law.step(input);
      ASSERT_TRUE(output.override_pct >= -kFarPct && output.override_pct <= kFarPct) << i;
      if (input.mode != LawMode::kActive) {
        ASSERT_EQ(output.override_pct, input.override_applied_pct);
      }
      ASSERT_GE(output.process_gain_n_pct, config.estimate.least_n_pct);
      ASSERT_LE(output.process_gain_n_pct, config.estimate.most_n_pct);
      ASSERT_TRUE(std::isfinite(law.wear_ratio()));
      ASSERT_TRUE(host_tests::same_bits(resumed.step(input), output));
      ASSERT_TRUE(host_tests::same_bits(resumed.state(), law.state()));
    }
    EXPECT_EQ(host_tests::allocation_count(), allocations);
  }
}

}  // namespace
}  // namespace cutforce::control
