#include "control/force_input.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>
#include <tuple>

#include "support/allocation_count.hpp"
#include "support/random_float.hpp"

namespace cutforce::control {
namespace {

constexpr ForceInput::Config kLathe{
    .stale_ticks = 2,
    .hold_ticks = 4,
    .recover_ticks = 3,
    .negative_tolerance_n = 30.0F,
    .highest_n = 10000.0F,
};
static_assert(kLathe.check());

constexpr ForceInput::Input good(float force_n) {
  return {.force_n = force_n, .force_sigma_n = 5.0F, .age_ticks = 0, .valid = true};
}
constexpr ForceInput::Input kMissing{
    .force_n = 777.0F, .force_sigma_n = 5.0F, .age_ticks = 0, .valid = false};

ForceInput trusting(float force_n) {
  auto gate = ForceInput::make(kLathe).value();
  for (int i = 0; i < 10; ++i) std::ignore = gate.step(good(force_n));
  return gate;
}

TEST(ForceInput, HoldsForTheHoldTimeThenIsLostThenMustBeGoodForAWhile) {
  auto gate = trusting(400.0F);
  for (int i = 0; i < 4; ++i) {
    const auto output = gate.step(kMissing);
    EXPECT_EQ(output.outcome, ForceOutcome::kHeld) << i;
    EXPECT_EQ(output.refusal, ForceRefusal::kMissing);
    EXPECT_FLOAT_EQ(output.force_n, 400.0F);
  }
  EXPECT_EQ(gate.step(kMissing).outcome, ForceOutcome::kLost);
  for (int i = 0; i < 2; ++i) {
    const auto output = gate.step(good(300.0F));
    EXPECT_EQ(output.outcome, ForceOutcome::kLost) << i;
    EXPECT_EQ(output.refusal, ForceRefusal::kRecovering);
    EXPECT_FLOAT_EQ(output.force_n, 400.0F);
  }
  EXPECT_EQ(gate.step(good(300.0F)).outcome, ForceOutcome::kFresh);
}

TEST(ForceInput, StartsLost) {
  auto gate = ForceInput::make(kLathe).value();
  EXPECT_EQ(gate.step(kMissing).outcome, ForceOutcome::kLost);
  EXPECT_EQ(gate.step(good(1.0F)).outcome, ForceOutcome::kLost);
  EXPECT_EQ(gate.step(good(1.0F)).outcome, ForceOutcome::kLost);
  EXPECT_EQ(gate.step(good(1.0F)).outcome, ForceOutcome::kFresh);
}

TEST(ForceInput, NamesWhyAForceIsRefused) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  const struct {
    ForceInput::Input input;
    ForceRefusal refusal;
  } cases[] = {
      {{400.0F, 5.0F, 0, false}, ForceRefusal::kMissing},
      {{400.0F, 5.0F, 3, true}, ForceRefusal::kStale},
      {{400.0F, 5.0F, 2, true}, ForceRefusal::kNone},
      {{kNan, 5.0F, 0, true}, ForceRefusal::kNotFinite},
      {{kInf, 5.0F, 0, true}, ForceRefusal::kNotFinite},
      {{-kInf, 5.0F, 0, true}, ForceRefusal::kNotFinite},
      {{400.0F, kNan, 0, true}, ForceRefusal::kSigma},
      {{400.0F, kInf, 0, true}, ForceRefusal::kSigma},
      {{400.0F, -1.0F, 0, true}, ForceRefusal::kSigma},
      {{-16.0F, 5.0F, 0, true}, ForceRefusal::kNegative},   // beyond 3 sigma
      {{-15.0F, 5.0F, 0, true}, ForceRefusal::kNone},       // noise around zero
      {{-31.0F, 50.0F, 0, true}, ForceRefusal::kNegative},  // no sigma excuses this
      {{-1.0F, 0.0F, 0, true}, ForceRefusal::kNegative},
      {{-0.0F, 0.0F, 0, true}, ForceRefusal::kNone},
      {{3e38F, 5.0F, 0, true}, ForceRefusal::kNone},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(testing::Message() << c.input.force_n << " +- " << c.input.force_sigma_n);
    auto gate = trusting(400.0F);
    EXPECT_EQ(gate.step(c.input).refusal, c.refusal);
  }
}

TEST(ForceInput, CountsSmallNegativeForceAsZeroAndHugeForceAsTheHighest) {
  EXPECT_FLOAT_EQ(trusting(0.0F).step(good(-15.0F)).force_n, 0.0F);
  EXPECT_FLOAT_EQ(trusting(0.0F).step(good(1e30F)).force_n, 10000.0F);
}

TEST(ForceInput, RefusesEveryConfigThatBreaksARule) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  using Config = ForceInput::Config;
  using Error = ForceInput::ConfigError;
  const struct {
    void (*spoil)(Config&);
    Error error;
  } cases[] = {
      {[](Config& c) { c.stale_ticks = 2'000'000; }, Error::kStale},
      {[](Config& c) { c.hold_ticks = 2'000'000; }, Error::kHold},
      {[](Config& c) { c.recover_ticks = 0; }, Error::kRecover},
      {[](Config& c) { c.negative_tolerance_n = -1.0F; }, Error::kTolerance},
      {[](Config& c) { c.negative_tolerance_n = kNan; }, Error::kTolerance},
      {[](Config& c) { c.negative_tolerance_n = 10000.0F; }, Error::kTolerance},
      {[](Config& c) { c.highest_n = kNan; }, Error::kTolerance},
      {[](Config& c) { c.highest_n = 1e9F; }, Error::kHighest},
  };
  for (const auto& c : cases) {
    Config config = kLathe;
    c.spoil(config);
    EXPECT_EQ(config.check().error(), c.error);
    EXPECT_FALSE(ForceInput::make(config));
  }
}

// Any bits at all: what passes is finite and in range, and an outcome is fresh iff nothing was
// wrong.
TEST(ForceInput, PassesNothingButGoodForcesUnderRandomBits) {
  std::mt19937 random(1);
  auto gate = ForceInput::make(kLathe).value();
  auto resumed = gate;
  const auto allocations = host_tests::allocation_count();
  for (int i = 0; i < 1'000'000; ++i) {
    ForceInput::Input input{.force_n = host_tests::any_float(random),
                            .force_sigma_n = host_tests::any_float(random),
                            .age_ticks = static_cast<std::uint32_t>(random() % 4),
                            .valid = random() % 8 != 0};
    if (random() % 2 == 0) input = good(static_cast<float>(random() % 1000));
    resumed.restore(gate.state());
    const auto output = gate.step(input);
    const auto again = resumed.step(input);
    ASSERT_TRUE(output.force_n >= 0.0F && output.force_n <= 10000.0F) << i;
    ASSERT_TRUE(output.force_sigma_n >= 0.0F && output.force_sigma_n <= 10000.0F) << i;
    ASSERT_EQ(output.outcome == ForceOutcome::kFresh, output.refusal == ForceRefusal::kNone) << i;
    ASSERT_EQ(std::memcmp(&output, &again, sizeof output), 0) << i;
  }
  EXPECT_EQ(host_tests::allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::control
