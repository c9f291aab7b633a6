#include "control/process_gain.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "support/allocation_count.hpp"
#include "support/random_float.hpp"

namespace cutforce::control {
namespace {

constexpr ProcessGain::Config kLiteral{
    .form = ProcessGain::Form::kLiteral,
    .literal_rate_1_pct = 0.006F,  // 0.003 per mm/min at 2 mm/min per %
    .normalised_rate_ratio = 0.6F,
    .soft_pct = 50.0F,
    .initial_n_pct = 8.0F,
    .least_n_pct = 0.4F,
    .most_n_pct = 100.0F,
    .excitation_n = 60.0F,
};
static_assert(kLiteral.check());

constexpr ProcessGain::Config normalised() {
  auto config = kLiteral;
  config.form = ProcessGain::Form::kNormalised;
  return config;
}
static_assert(normalised().check());

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

// What is left of an error of the gain after one tick at a constant override.
float left_of_the_error(const ProcessGain::Config& config, float applied_pct) {
  constexpr float kTrue = 10.0F;
  const auto estimator = ProcessGain::make(config).value();
  auto state = estimator.initial();
  EXPECT_TRUE(estimator.learn(state, cutting(kTrue * applied_pct, applied_pct)));
  return (kTrue - state.gain_n_pct) / (kTrue - config.initial_n_pct);
}

// 1 - g_c U: from slow through deadbeat to alternating, and no further than config allows (C23).
TEST(ProcessGain, ShrinksItsErrorByTheFactorOfTheSheetInBothForms) {
  auto literal = kLiteral;
  for (const float rate : {0.0002F, 0.003F, 0.006F, 0.0078F}) {
    literal.literal_rate_1_pct = rate;
    for (const float applied_pct : {10.0F, 100.0F, 150.0F, 254.0F}) {
      EXPECT_NEAR(left_of_the_error(literal, applied_pct), 1.0F - rate * applied_pct, 2e-5F);
      EXPECT_LT(std::abs(left_of_the_error(literal, applied_pct)), 1.0F);
    }
  }
  auto other = normalised();
  for (const float rate : {0.1F, 1.0F, 1.9F}) {
    other.normalised_rate_ratio = rate;
    for (const float applied_pct : {10.0F, 50.0F, 254.0F}) {
      const float weight = applied_pct * applied_pct / (2500.0F + applied_pct * applied_pct);
      EXPECT_NEAR(left_of_the_error(other, applied_pct), 1.0F - rate * weight, 2e-5F);
    }
  }
}

TEST(ProcessGain, LearnsNothingWithoutExcitation) {
  const auto estimator = ProcessGain::make(kLiteral).value();
  const struct {
    void (*spoil)(LawInput&);
  } cases[] = {
      {[](LawInput& i) { i.force_n = 59.9F; }},
      {[](LawInput& i) { i.phase = CutPhase::kAir; }},
      {[](LawInput& i) { i.phase = CutPhase::kExit; }},
      {[](LawInput& i) { i.mode = LawMode::kHold; }},
      {[](LawInput& i) { i.override_applied_pct = 0.0F; }},
      {[](LawInput& i) { i.override_applied_pct = 1e6F; }},
  };
  for (const auto& c : cases) {
    auto state = estimator.initial();
    auto input = cutting(2000.0F, 100.0F);
    c.spoil(input);
    EXPECT_FALSE(estimator.learn(state, input));
    EXPECT_EQ(state.gain_n_pct, kLiteral.initial_n_pct);
    EXPECT_EQ(state.deviation_ratio, 1.0F);
  }
  for (const CutPhase phase : {CutPhase::kEntry, CutPhase::kCut}) {
    for (const LawMode mode : {LawMode::kActive, LawMode::kTrack}) {
      auto state = estimator.initial();
      auto input = cutting(2000.0F, 100.0F);
      input.phase = phase;
      input.mode = mode;
      EXPECT_TRUE(estimator.learn(state, input));
    }
  }
}

// White noise of the force: innovations sqrt(2/(2 - q)), the gain sqrt(q/(2 - q)) times as wide,
// q = g_c U. What is published is the first, an upper bound of the second.
TEST(ProcessGain, PublishesAnUpperBoundOfItsOwnDeviation) {
  const auto estimator = ProcessGain::make(kLiteral).value();
  auto state = estimator.initial();
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0.0F, 0.02F);
  double square = 0.0;
  double published = 0.0;
  constexpr int kTicks = 200'000;
  for (int i = 0; i < kTicks + 100; ++i) {
    estimator.learn(state, cutting(1000.0F * (1.0F + noise(random)), 100.0F));
    if (i < 100) continue;
    const double relative = static_cast<double>(state.gain_n_pct) / 10.0 - 1.0;
    square += relative * relative / kTicks;
    published += static_cast<double>(ProcessGain::sigma_ratio(state)) / kTicks;
  }
  EXPECT_NEAR(std::sqrt(square), 0.02 * std::sqrt(0.6 / 1.4), 2e-4);
  EXPECT_NEAR(published, 0.02 * std::sqrt(2.0 / 1.4), 2e-4);
}

// A gain that has just doubled is wrong by half of what it now is: sigma must say so at once.
TEST(ProcessGain, KnowsThatItKnowsLittleAfterAJump) {
  auto config = kLiteral;
  config.literal_rate_1_pct = 0.001F;
  const auto estimator = ProcessGain::make(config).value();
  auto state = estimator.initial();
  for (int i = 0; i < 200; ++i) estimator.learn(state, cutting(800.0F, 100.0F));
  EXPECT_LT(ProcessGain::sigma_ratio(state), 1e-3F);
  estimator.learn(state, cutting(1600.0F, 100.0F));
  EXPECT_GT(ProcessGain::sigma_ratio(state), 0.2F);
}

TEST(ProcessGain, RefusesEveryConfigThatBreaksARule) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  using Config = ProcessGain::Config;
  using Error = ProcessGain::ConfigError;
  const struct {
    Config good;
    void (*spoil)(Config&);
    Error error;
  } cases[] = {
      {kLiteral, [](Config& c) { c.form = static_cast<ProcessGain::Form>(2); }, Error::kForm},
      {kLiteral, [](Config& c) { c.literal_rate_1_pct = 0.0F; }, Error::kRate},
      {kLiteral, [](Config& c) { c.literal_rate_1_pct = -0.001F; }, Error::kRate},
      {kLiteral, [](Config& c) { c.literal_rate_1_pct = 0.00785F; }, Error::kRate},  // 2/255
      {kLiteral, [](Config& c) { c.literal_rate_1_pct = kNan; }, Error::kRate},
      {normalised(), [](Config& c) { c.normalised_rate_ratio = 0.0F; }, Error::kRate},
      {normalised(), [](Config& c) { c.normalised_rate_ratio = 2.0F; }, Error::kRate},
      {normalised(), [](Config& c) { c.normalised_rate_ratio = kNan; }, Error::kRate},
      {normalised(), [](Config& c) { c.soft_pct = -1.0F; }, Error::kRate},
      {normalised(), [](Config& c) { c.soft_pct = kNan; }, Error::kRate},
      {kLiteral, [](Config& c) { c.least_n_pct = 0.0F; }, Error::kRange},
      {kLiteral, [](Config& c) { c.least_n_pct = 9.0F; }, Error::kRange},
      {kLiteral, [](Config& c) { c.most_n_pct = 7.0F; }, Error::kRange},
      {kLiteral, [](Config& c) { c.most_n_pct = 1e30F; }, Error::kRange},
      {kLiteral, [](Config& c) { c.initial_n_pct = kNan; }, Error::kRange},
      {kLiteral, [](Config& c) { c.excitation_n = -1.0F; }, Error::kExcitation},
      {kLiteral, [](Config& c) { c.excitation_n = kNan; }, Error::kExcitation},
  };
  for (const auto& c : cases) {
    Config config = c.good;
    EXPECT_TRUE(config.check());
    c.spoil(config);
    EXPECT_EQ(config.check().error(), c.error);
    EXPECT_FALSE(ProcessGain::make(config));
  }
}

// Any finite force up to the largest float, any override at all.
TEST(ProcessGain, StaysWithinItsLimitsWhateverComesWithoutAllocating) {
  std::mt19937 random(8);
  for (auto config : {kLiteral, normalised()}) {
    config.soft_pct = 0.0F;
    const auto estimator = ProcessGain::make(config).value();
    auto state = estimator.initial();
    const auto allocations = host_tests::allocation_count();
    for (int i = 0; i < 200'000; ++i) {
      float force_n = std::abs(host_tests::any_float(random));
      if (!std::isfinite(force_n)) force_n = std::numeric_limits<float>::max();
      const float applied_pct =
          random() % 2 == 0 ? host_tests::any_float(random) : static_cast<float>(random() % 256);
      auto input =
          cutting(random() % 2 == 0 ? force_n : static_cast<float>(random() % 5000), applied_pct);
      input.mode = static_cast<LawMode>(random() % 3);
      input.phase = static_cast<CutPhase>(random() % 4);
      estimator.learn(state, input);
      ASSERT_TRUE(state.gain_n_pct >= config.least_n_pct && state.gain_n_pct <= config.most_n_pct);
      ASSERT_TRUE(state.deviation_ratio >= 0.0F && state.deviation_ratio <= 1.0F) << i;
    }
    EXPECT_EQ(host_tests::allocation_count(), allocations);
  }
}

}  // namespace
}  // namespace cutforce::control
