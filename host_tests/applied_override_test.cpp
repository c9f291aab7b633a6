#include "control/applied_override.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>
#include <tuple>

#include "support/allocation_count.hpp"
#include "support/random_float.hpp"

namespace cutforce::control {
namespace {

constexpr AppliedOverride::Config kCnc{
    .delay_ticks = 4,
    .confirm_ticks = 3,
    .tolerance_pct = 1.0F,
    .initial_pct = 100,
};
static_assert(kCnc.check());

TEST(AppliedOverride, IsWhatWasSentWhileTheCncFollowsLate) {
  auto applied = AppliedOverride::make(kCnc).value();
  for (int i = 0; i < 100; ++i) {
    const auto sent = [](int tick) { return static_cast<std::uint8_t>(100 + tick % 60); };
    const auto output = applied.step({.sent_pct = sent(i),
                                      .reported_pct = static_cast<float>(i < 4 ? 100 : sent(i - 4)),
                                      .reported = true});
    EXPECT_TRUE(output.follows) << i;
    EXPECT_FLOAT_EQ(output.applied_pct, sent(i));
  }
}

TEST(AppliedOverride, IsTheReportOnceTheCncIsSeenNotToFollow) {
  auto applied = AppliedOverride::make(kCnc).value();
  const AppliedOverride::Input locked{.sent_pct = 60, .reported_pct = 100.0F, .reported = true};
  // Within the longest delay of the report nothing is known; then it has to be confirmed.
  for (int i = 0; i < 6; ++i) EXPECT_FLOAT_EQ(applied.step(locked).applied_pct, 60.0F) << i;
  const auto output = applied.step(locked);
  EXPECT_FLOAT_EQ(output.applied_pct, 100.0F);
  EXPECT_FALSE(output.follows);
  EXPECT_TRUE(applied.step({.sent_pct = 60, .reported_pct = 60.0F, .reported = true}).follows);
}

TEST(AppliedOverride, TakesAnImpossibleReportForNone) {
  for (const float reported_pct : {std::numeric_limits<float>::quiet_NaN(), -1.0F, 256.0F,
                                   std::numeric_limits<float>::infinity()}) {
    auto applied = AppliedOverride::make(kCnc).value();
    for (int i = 0; i < 20; ++i) {
      const auto output =
          applied.step({.sent_pct = 60, .reported_pct = reported_pct, .reported = true});
      EXPECT_FLOAT_EQ(output.applied_pct, 60.0F);
      EXPECT_TRUE(output.follows);
    }
  }
}

TEST(AppliedOverride, RefusesEveryConfigThatBreaksARule) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  using Config = AppliedOverride::Config;
  using Error = AppliedOverride::ConfigError;
  const struct {
    void (*spoil)(Config&);
    Error error;
  } cases[] = {
      {[](Config& c) { c.delay_ticks = 16; }, Error::kDelay},
      {[](Config& c) { c.confirm_ticks = 0; }, Error::kConfirm},
      {[](Config& c) { c.tolerance_pct = -1.0F; }, Error::kTolerance},
      {[](Config& c) { c.tolerance_pct = kNan; }, Error::kTolerance},
      {[](Config& c) { c.initial_pct = 255; }, Error::kInitial},
  };
  for (const auto& c : cases) {
    Config config = kCnc;
    c.spoil(config);
    EXPECT_EQ(config.check().error(), c.error);
    EXPECT_FALSE(AppliedOverride::make(config));
  }
}

TEST(AppliedOverride, StaysAPercentageUnderRandomBitsAndContinuesFromASnapshot) {
  std::mt19937 random(6);
  auto applied = AppliedOverride::make(kCnc).value();
  auto resumed = applied;
  const auto allocations = host_tests::allocation_count();
  for (int i = 0; i < 300'000; ++i) {
    const AppliedOverride::Input input{.sent_pct = static_cast<std::uint8_t>(random() % 255),
                                       .reported_pct = random() % 2 == 0
                                                           ? host_tests::any_float(random)
                                                           : static_cast<float>(random() % 255),
                                       .reported = random() % 4 != 0};
    resumed.restore(applied.state());
    const auto output = applied.step(input);
    ASSERT_TRUE(output.applied_pct >= 0.0F && output.applied_pct <= 255.0F) << i;
    std::ignore = resumed.step(input);
    ASSERT_EQ(std::memcmp(&applied.state(), &resumed.state(), sizeof(AppliedOverride::State)), 0);
  }
  EXPECT_EQ(host_tests::allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::control
