#include "control/path_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "support/allocation_count.hpp"
#include "support/predictive_lathe.hpp"
#include "support/same_bits.hpp"

namespace cutforce::control {
namespace {

using hal::host::Profile;
using host_tests::cut;
using host_tests::LatheTick;

constexpr PathMap::Config kLathe{.period_s = 0.05F,
                                 .feed_lag_s = 0.03F,
                                 .sensor_lag_s = 0.03F,
                                 .feed_exponent = 0.864F,
                                 .gain_n = 400.0F};
static_assert(kLathe.check());

constexpr PathMap::Lesson lesson(float feed_ratio, float gain_n) {
  return {.feed_ratio = feed_ratio,
          .gain_n = gain_n,
          .jumped = false,
          .rising = false,
          .resolving = false,
          .steady = false};
}

constexpr PathMap::Question question(float override_pct) {
  return {.reference_n = 500.0F,
          .ahead_s = 0.0F,
          .force_n = 500.0F,
          .override_pct = override_pct,
          .spindle_ratio = 1.0F,
          .air = false};
}

// 1 s of 1 mm, then 3 mm, at 100 %.
PathMap a_step() {
  auto map = PathMap::make(kLathe).value();
  map.start();
  for (int i = 0; i < 40; ++i) map.learn(lesson(1.0F, i < 20 ? 400.0F : 1200.0F));
  map.start();
  return map;
}

// Force now over force then, from the override that the map keeps of it.
float wear_of(const PathMap& map) { return std::pow(map.state().wear_feed_ratio, -0.864F); }

float override_of(float gain_n) { return 100.0F * std::pow(500.0F / gain_n, 1.0F / 0.864F); }

TEST(PathMap, BrakesOnTheWayToAHeavierCutAndHoldsItsOverride) {
  auto map = a_step();
  std::vector<float> allowed;
  for (int i = 0; i < 36; ++i) {
    allowed.push_back(map.limit(question(200.0F)));
    map.learn(lesson(1.0F, 0.0F));
  }
  EXPECT_NEAR(allowed[5], override_of(400.0F), 1.0F);    // 1 mm
  EXPECT_NEAR(allowed[30], override_of(1200.0F), 1.0F);  // 3 mm
  // Before 3 mm (seen 0.055 s late, at 0.945 s) it brakes, and not a quarter of a second
  // before.
  EXPECT_NEAR(allowed[13], override_of(400.0F), 1.0F);
  EXPECT_LT(allowed[19], override_of(1200.0F) + 1.0F);
}

TEST(PathMap, SaysNothingWhereNothingIsKnown) {
  auto map = PathMap::make(kLathe).value();
  for (const bool started : {false, true}) {
    if (started) map.start();
    for (int i = 0; i < 100; ++i) {
      EXPECT_EQ(map.limit(question(200.0F)), 200.0F);
      map.learn(lesson(1.0F, 400.0F));
    }
  }
  // Beyond the end of what the last part taught, and in its air.
  auto air = PathMap::make(kLathe).value();
  air.start();
  for (int i = 0; i < 40; ++i) air.learn(lesson(1.0F, 0.0F));
  air.start();
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(air.limit(question(200.0F)), 200.0F);
    air.learn(lesson(1.0F, 400.0F));
  }
}

// Whatever the spindle is said to do, and at either end of what a cell can hold, where most cells
// are passed over by their whole number alone.
TEST(PathMap, NeverRaisesAndStaysANumberAtAnySpindleRatioAndOverride) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float ratio : {0.0F, -1.0F, 1e-30F, 0.5F, 2.0F, 1e30F, infinity, nan}) {
    for (const float override_pct : {0.0F, 1.0F, 20.0F, 100.0F, 254.0F}) {
      auto map = a_step();
      for (int i = 0; i < 36; ++i) {
        auto asked = question(override_pct);
        asked.spindle_ratio = ratio;
        const float allowed = map.limit(asked);
        EXPECT_LE(allowed, override_pct) << ratio;
        EXPECT_TRUE(std::isfinite(allowed)) << ratio;
        map.learn(lesson(1.0F, 0.0F));
      }
    }
  }
}

// A cell that asks for a hair less than the override binds, one that asks for as much does not.
TEST(PathMap, HoldsACellToTheLastBitOfItsOverride) {
  auto map = a_step();
  const float there_pct = map.limit(question(200.0F));
  EXPECT_NEAR(there_pct, override_of(400.0F), 0.15F);  // a cell holds 0.1 %
  float above_pct = there_pct;
  float below_pct = there_pct;
  for (int k = 0; k < 200; ++k) {
    EXPECT_EQ(map.limit(question(above_pct)), there_pct);
    EXPECT_EQ(map.limit(question(below_pct)), below_pct);
    above_pct = std::nextafter(above_pct, 254.0F);
    below_pct = std::nextafter(below_pct, 0.0F);
  }
}

// Any past, any question.
TEST(PathMap, OnlyEverLowersAndContinuesBitExactlyWithoutAllocating) {
  std::mt19937 random(37);
  const auto part = [&random] { return static_cast<float>(random() % 10'000) * 1e-4F; };
  auto map = PathMap::make(kLathe).value();
  auto resumed = map;
  const auto allocations = host_tests::allocation_count();
  int lowered = 0;
  for (int i = 0; i < 200'000; ++i) {
    if (random() % 400 == 0) {
      map.start();
      resumed.restore(map.state());
    }
    auto taught = lesson(2.0F * part(), random() % 4 == 0 ? 1e4F * part() : 400.0F);
    taught.jumped = random() % 16 == 0;
    taught.rising = random() % 2 == 0;
    taught.resolving = random() % 8 == 0;
    taught.steady = random() % 2 == 0;
    map.learn(taught);
    resumed.learn(taught);
    auto asked = question(255.0F * part());
    asked.reference_n = 1.0F + 5000.0F * part();
    asked.force_n = 1000.0F * part();
    asked.ahead_s = part();
    asked.spindle_ratio = 2.0F * part();
    asked.air = random() % 4 == 0;
    const float allowed = map.limit(asked);
    ASSERT_TRUE(allowed >= 0.0F && allowed <= asked.override_pct) << i;
    if (allowed < asked.override_pct) ++lowered;
    ASSERT_EQ(resumed.limit(asked), allowed);
    ASSERT_TRUE(wear_of(map) > 0.6999F && wear_of(map) < 1.5001F);
    if (i % 100 == 0) {
      ASSERT_TRUE(host_tests::same_bits(map.state(), resumed.state()));
    }
  }
  EXPECT_GT(lowered, 1000);
  EXPECT_EQ(host_tests::allocation_count(), allocations);
}

// While the estimate is held the tool moves on: the steps of the next part are where they were.
TEST(PathMap, KeepsItsPlaceThroughAHeldEstimate) {
  auto config = host_tests::kPredictiveLathe;
  config.learns = true;
  auto law = Predictive::make(config).value();
  LawInput input{.force_reference_n = 500.0F,
                 .force_n = 500.0F,
                 .force_sigma_n = 4.0F,
                 .override_applied_pct = 100.0F,
                 .override_tolerance_pct = 0.5F,
                 .spindle_ratio = 1.0F,
                 .phase = CutPhase::kCut,
                 .mode = LawMode::kTrack,
                 .part_start = true};
  for (int i = 0; i < 100; ++i) {
    input.mode = i % 3 == 0 ? LawMode::kHold : LawMode::kTrack;
    (void)law.step(input);
    input.part_start = false;
  }
  EXPECT_NEAR(law.state().map.position_s, 5.0F, 1e-3F);
}

TEST(PathMap, FollowsWearWithinItsBounds) {
  for (const float wear : {0.85F, 1.2F, 1.28F, 3.0F}) {
    auto map = PathMap::make(kLathe).value();
    map.start();
    for (int i = 0; i < 400; ++i) map.learn(lesson(1.0F, 400.0F));
    map.start();
    for (int i = 0; i < 300; ++i) {
      auto taught = lesson(1.0F, 400.0F * wear);
      taught.steady = true;
      map.learn(taught);
    }
    const float expected = wear > 2.0F ? 1.0F : wear;  // three times as much is no wear
    EXPECT_NEAR(wear_of(map), expected, 0.01F);
    EXPECT_NEAR(map.limit(question(200.0F)), override_of(400.0F * expected), 2.0F);
  }
}

// Stairs of up to 3 mm out of the air; `shifted_m` is how far off the next part lies.
hal::host::ForceMachineConfig stairs(double shifted_m, std::uint64_t seed,
                                     double deepest_m = 3e-3) {
  std::vector<hal::host::ProfilePoint> points;
  const double depths_m[] = {0.0, 1e-3, deepest_m, 1.5e-3, 0.0, 2e-3, 1e-3};
  double at_m = 0.0;
  for (const double depth_m : depths_m) {
    points.push_back({at_m, depth_m});
    at_m += at_m > 0.0 ? 7e-3 : 7e-3 + shifted_m;
    points.push_back({at_m, depth_m});
  }
  auto part = host_tests::lathe_part(Profile(points), at_m);
  host_tests::add_noise(part, seed);
  return part;
}

struct Score {
  double above_ns = 0.0;  // 105 %
  double peak_n = 0.0;
  double time_s = 0.0;
};

Score score(const std::vector<LatheTick>& ticks) {
  Score s;
  for (const LatheTick& t : ticks) {
    s.above_ns += 0.05 * std::max(t.before.force_n - 525.0, 0.0);
    s.peak_n = std::max(s.peak_n, t.peak_n);
  }
  s.time_s = ticks.back().before.time_s;
  return s;
}

host_tests::PredictivePath learning_path() {
  auto law = host_tests::kPredictiveLathe;
  law.learns = true;
  return host_tests::PredictivePath::make(host_tests::predictive_path(law)).value();
}

TEST(PathMap, MakesTheSecondPartOfAKindGentle) {
  for (const double shifted_m : {0.0, 0.2e-3, -0.2e-3}) {
    SCOPED_TRACE(shifted_m);
    auto path = learning_path();
    const Score first = score(cut(path, stairs(0.0, 1), 60.0));
    const Score second = score(cut(path, stairs(shifted_m, 2), 60.0));
    RecordProperty("first_ns_" + std::to_string(shifted_m), std::to_string(first.above_ns));
    RecordProperty("second_ns_" + std::to_string(shifted_m), std::to_string(second.above_ns));
    RecordProperty("second_peak_n_" + std::to_string(shifted_m), std::to_string(second.peak_n));
    RecordProperty("time_ratio_" + std::to_string(shifted_m),
                   std::to_string(second.time_s / first.time_s));
    EXPECT_GT(first.above_ns, 20.0);
    EXPECT_LT(second.above_ns, 0.05 * first.above_ns);
    EXPECT_LT(second.peak_n, 1.10 * 500.0);
    EXPECT_LT(second.time_s, 1.10 * first.time_s);  // nothing but steps: 8 % is the mark of a suite
  }
}

// The map is of another part: heavy where this one is light. It is doubted and the part finishes.
TEST(PathMap, IsNotBelievedForLongWhereItIsWrong) {
  auto light = host_tests::lathe_part(Profile(1e-3), 42e-3);
  host_tests::add_noise(light, 3);
  auto heavy = host_tests::lathe_part(Profile(3.5e-3), 42e-3);
  host_tests::add_noise(heavy, 4);
  auto fresh = learning_path();
  const Score without = score(cut(fresh, light, 60.0));
  auto path = learning_path();
  (void)score(cut(path, heavy, 60.0));
  const auto ticks = cut(path, light, 60.0);
  const Score with = score(ticks);
  RecordProperty("time_ratio", std::to_string(with.time_s / without.time_s));
  EXPECT_GT(ticks.back().before.position_m, 40e-3);
  EXPECT_EQ(path.state().law.map.trusted, 0U);
  EXPECT_LT(with.time_s, 1.25 * without.time_s);
  EXPECT_LT(with.peak_n, 1.15 * without.peak_n);
  // And the part after it has learned the light one.
  const Score third = score(cut(path, light, 60.0));
  RecordProperty("third_time_ratio", std::to_string(third.time_s / without.time_s));
  EXPECT_LT(third.time_s, 1.08 * without.time_s);
  EXPECT_LT(third.peak_n, 1.10 * 500.0);
}

TEST(PathMap, RefusesEveryConfigThatBreaksARule) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  using Config = PathMap::Config;
  using Error = PathMap::ConfigError;
  const struct {
    void (*spoil)(Config&);
    Error error;
  } cases[] = {
      {[](Config& c) { c.period_s = 0.0F; }, Error::kPeriod},
      {[](Config& c) { c.period_s = kNan; }, Error::kPeriod},
      {[](Config& c) { c.feed_lag_s = -1.0F; }, Error::kLags},
      {[](Config& c) { c.feed_lag_s = kNan; }, Error::kLags},
      {[](Config& c) { c.sensor_lag_s = kNan; }, Error::kLags},
      {[](Config& c) { c.feed_exponent = 0.0F; }, Error::kExponent},
      {[](Config& c) { c.feed_exponent = kNan; }, Error::kExponent},
      {[](Config& c) { c.gain_n = 0.0F; }, Error::kGain},
      {[](Config& c) { c.gain_n = kNan; }, Error::kGain},
  };
  for (const auto& c : cases) {
    Config config = kLathe;
    c.spoil(config);
    ASSERT_FALSE(config.check());
    EXPECT_EQ(config.check().error(), c.error);
    EXPECT_FALSE(PathMap::make(config));
  }
}

}  // namespace
}  // namespace cutforce::control
