#include "control/feed_override.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>
#include <tuple>
#include <vector>

#include "support/allocation_count.hpp"
#include "support/random_float.hpp"

namespace cutforce::control {
namespace {

constexpr FeedOverride::Config kFine{
    .period_s = 0.05F,
    .floor_pct = 20.0F,
    .ceiling_pct = 200.0F,
    .step_pct = 1,
    .hysteresis_pct = 0.25F,
    .slew_up_pct_s = 100.0F,
    .slew_down_pct_s = 1000.0F,
    .initial_pct = 100.0F,
};
static_assert(kFine.check());

constexpr FeedOverride::Config kCoarse{
    .period_s = 0.05F,
    .floor_pct = 15.0F,
    .ceiling_pct = 155.0F,
    .step_pct = 10,
    .hysteresis_pct = 2.0F,
    .slew_up_pct_s = 20.0F,
    .slew_down_pct_s = 200.0F,
    .initial_pct = 100.0F,
};
static_assert(kCoarse.check());

TEST(FeedOverride, RampsUpAndDownAtItsRatesAndReportsThem) {
  auto override = FeedOverride::make(kFine).value();
  for (int i = 1; i <= 20; ++i) {  // 5 % a tick
    const auto output = override.step({.wanted_pct = 1000.0F, .may_rise = true});
    EXPECT_EQ(output.override_pct, 100 + 5 * i);
    EXPECT_EQ(output.limits, i < 20 ? kCeilingLimit | kSlewUpLimit : kCeilingLimit) << i;
  }
  EXPECT_EQ(override.step({.wanted_pct = 0.0F, .may_rise = true}).override_pct, 150);
  EXPECT_EQ(override.step({.wanted_pct = 0.0F, .may_rise = true}).override_pct, 100);
  EXPECT_EQ(override.step({.wanted_pct = 30.0F, .may_rise = true}).limits, kSlewDownLimit);
}

// A slew rate below one step a tick must still arrive: 1 % a tick, steps of 10 %.
TEST(FeedOverride, MovesInWholeStepsAtASlowRate) {
  auto override = FeedOverride::make(kCoarse).value();
  std::vector<int> sent;
  for (int i = 0; i < 60; ++i) {
    const int now = override.step({.wanted_pct = 150.0F, .may_rise = true}).override_pct;
    if (sent.empty() || sent.back() != now) sent.push_back(now);
  }
  EXPECT_EQ(sent, (std::vector<int>{100, 110, 120, 130, 140, 150}));
}

TEST(FeedOverride, KeepsFloorAndCeilingInwardOfThemselvesInCoarseSteps) {
  auto override = FeedOverride::make(kCoarse).value();
  for (int i = 0; i < 1000; ++i)
    std::ignore = override.step({.wanted_pct = -1e30F, .may_rise = true});
  EXPECT_EQ(override.sent_pct(), 20);
  for (int i = 0; i < 1000; ++i)
    std::ignore = override.step({.wanted_pct = 1e30F, .may_rise = true});
  EXPECT_EQ(override.sent_pct(), 150);
}

TEST(FeedOverride, DoesNotHuntBetweenTwoStepsOnSmallMotion) {
  auto override = FeedOverride::make(kFine).value();
  std::ignore = override.step({.wanted_pct = 104.0F, .may_rise = true});
  int changes = 0;
  for (int i = 0; i < 200; ++i) {  // +-0.2 % around the edge between 103 and 104
    const auto before = override.sent_pct();
    std::ignore = override.step({.wanted_pct = i % 2 == 0 ? 103.3F : 103.7F, .may_rise = true});
    changes += override.sent_pct() != before;
  }
  EXPECT_EQ(changes, 0);
}

TEST(FeedOverride, HoldsOnWhatIsNotFinite) {
  auto override = FeedOverride::make(kFine).value();
  for (const float wanted_pct :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
        -std::numeric_limits<float>::infinity()}) {
    const auto output = override.step({.wanted_pct = wanted_pct, .may_rise = true});
    EXPECT_EQ(output.override_pct, 100);
    EXPECT_EQ(output.limits, kNotFinite);
  }
}

TEST(FeedOverride, RefusesEveryConfigThatBreaksARule) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  using Config = FeedOverride::Config;
  using Error = FeedOverride::ConfigError;
  const struct {
    void (*spoil)(Config&);
    Error error;
  } cases[] = {
      {[](Config& c) { c.period_s = -1.0F; }, Error::kPeriod},
      {[](Config& c) { c.period_s = kNan; }, Error::kPeriod},
      {[](Config& c) { c.step_pct = 0; }, Error::kStep},
      {[](Config& c) { c.step_pct = 5; }, Error::kStep},
      {[](Config& c) { c.floor_pct = 200.0F; }, Error::kRange},
      {[](Config& c) { c.floor_pct = -1.0F; }, Error::kRange},
      {[](Config& c) { c.floor_pct = kNan; }, Error::kRange},
      {[](Config& c) { c.ceiling_pct = 255.0F; }, Error::kRange},
      {[](Config& c) { c.ceiling_pct = kNan; }, Error::kRange},
      {[](Config& c) { c.floor_pct = 20.2F, c.ceiling_pct = 20.8F; }, Error::kRange},
      {[](Config& c) { c.hysteresis_pct = 0.5F; }, Error::kHysteresis},
      {[](Config& c) { c.hysteresis_pct = kNan; }, Error::kHysteresis},
      {[](Config& c) { c.slew_up_pct_s = 0.0F; }, Error::kSlew},
      {[](Config& c) { c.slew_down_pct_s = kNan; }, Error::kSlew},
      {[](Config& c) { c.initial_pct = 10.0F; }, Error::kInitial},
      {[](Config& c) { c.initial_pct = kNan; }, Error::kInitial},
  };
  for (const auto& c : cases) {
    Config config = kFine;
    c.spoil(config);
    EXPECT_EQ(config.check().error(), c.error);
    EXPECT_FALSE(FeedOverride::make(config));
  }
}

// Floor, ceiling, step, rates and the ban on rising hold whatever bits are wanted.
TEST(FeedOverride, StaysWithinItsLimitsUnderRandomBits) {
  std::mt19937 random(3);
  for (const auto& config : {kFine, kCoarse}) {
    auto override = FeedOverride::make(config).value();
    auto resumed = override;
    std::vector<float> history(64, 100.0F);
    const auto allocations = host_tests::allocation_count();
    const float up_pct = config.slew_up_pct_s * config.period_s;
    const float slack_pct = static_cast<float>(config.step_pct) + 2.0F * config.hysteresis_pct;
    for (std::size_t i = 0; i < 500'000; ++i) {
      FeedOverride::Input input{.wanted_pct = host_tests::any_float(random),
                                .may_rise = random() % 4 != 0};
      if (random() % 4 != 0) input.wanted_pct = static_cast<float>(random() % 3000) / 10.0F;
      const int before = override.sent_pct();
      resumed.restore(override.state());
      const auto output = override.step(input);
      ASSERT_EQ(resumed.step(input).limits, output.limits);
      ASSERT_EQ(std::memcmp(&override.state(), &resumed.state(), sizeof(FeedOverride::State)), 0);

      const auto sent_pct = static_cast<float>(output.override_pct);
      ASSERT_TRUE(sent_pct >= config.floor_pct && sent_pct <= config.ceiling_pct) << i;
      ASSERT_EQ(output.override_pct % config.step_pct, 0U) << i;
      if (!input.may_rise) {
        ASSERT_LE(output.override_pct, before) << i;
      }
      for (std::size_t back = 1; back < history.size(); back += 7) {
        const float earlier_pct = history[(i + history.size() - back) % history.size()];
        ASSERT_LE(sent_pct - earlier_pct, static_cast<float>(back) * up_pct + slack_pct + 1e-3F);
      }
      history[i % history.size()] = sent_pct;
    }
    EXPECT_EQ(host_tests::allocation_count() - allocations, 0U);
  }
}

}  // namespace
}  // namespace cutforce::control
