#include "control/force_model.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "support/allocation_count.hpp"

namespace cutforce::control {
namespace {

// The three lags of (C70), integrated in steps of a few microseconds (Heun).
struct Lags {
  double feed_s, cut_s, sensor_s;
  double v = 0.0, force = 0.0, sensed = 0.0;
  double path = 0.0;  // integral of v

  struct Slope {
    double v, force, sensed;
  };
  [[nodiscard]] Slope slope(double w, double gain) const {
    return {(w - v) / feed_s, (gain * v - force) / cut_s, (force - sensed) / sensor_s};
  }
  void run(double length_s, double w, double gain) {
    const int steps = std::max(1, static_cast<int>(length_s / 5e-6));
    const double h = length_s / steps;
    for (int k = 0; k < steps; ++k) {
      const Slope a = slope(w, gain);
      Lags next = *this;
      next.v += h * a.v;
      next.force += h * a.force;
      next.sensed += h * a.sensed;
      const Slope b = next.slope(w, gain);
      path += h * v + 0.5 * h * h * a.v;
      v += 0.5 * h * (a.v + b.v);
      force += 0.5 * h * (a.force + b.force);
      sensed += 0.5 * h * (a.sensed + b.sensed);
    }
  }
};

TEST(ForceModel, IsTheIntegralOfTheThreeLags) {
  std::mt19937 random(1);
  const auto between = [&random](double low, double high) {
    return low + (high - low) * static_cast<double>(random() % 10'000) / 1e4;
  };
  for (int i = 0; i < 60; ++i) {
    Lags exact{
        .feed_s = between(0.01, 0.2), .cut_s = between(0.02, 0.3), .sensor_s = between(0.005, 0.1)};
    if (std::abs(exact.cut_s - exact.sensor_s) < 0.02 * exact.cut_s) continue;
    exact.v = between(0.0, 2.0);
    exact.force = between(0.0, 2.0);
    exact.sensed = between(0.0, 2.0);
    const double length_s = between(0.001, 0.1);
    const double w = between(0.0, 2.0);
    const auto step =
        LagStep::of(static_cast<float>(length_s), static_cast<float>(exact.feed_s),
                    static_cast<float>(exact.cut_s), static_cast<float>(exact.sensor_s));

    FeedState feed{.v = static_cast<float>(exact.v)};
    Lags moving = exact;
    moving.run(length_s, w, 1.0);
    const float mean = feed.advance(step, static_cast<float>(w));
    EXPECT_NEAR(feed.v, moving.v, 1e-5) << i;
    EXPECT_NEAR(mean, moving.path / length_s, 2e-5) << i;

    // Cut and sensor, with a feed that stands still: v = 1.5.
    Lags still = exact;
    still.v = 1.5;
    still.run(length_s, 1.5, 1.0);
    const double force =
        static_cast<double>(step.cut) * exact.force + (1.0 - static_cast<double>(step.cut)) * 1.5;
    const double sensed = static_cast<double>(step.sensed) * exact.sensed +
                          static_cast<double>(step.sensed_force) * exact.force +
                          static_cast<double>(step.sensed_input) * 1.5;
    EXPECT_NEAR(force, still.force, 1e-5) << i;
    EXPECT_NEAR(sensed, still.sensed, 2e-5) << i;
  }
}

// The mean of v stands for v within a tick. What that costs on the lathe, at the worst moment of a
// step of the override: bounded on both sides.
TEST(ForceModel, IsCloseToTheLagsWhileTheFeedMoves) {
  const auto step = LagStep::of(0.05F, 0.03F, 0.1F, 0.031F);
  Lags exact{.feed_s = 0.03, .cut_s = 0.1, .sensor_s = 0.031};
  FeedState feed;
  float force = 0.0F;
  float sensed = 0.0F;
  double worst = 0.0;
  for (int k = 0; k < 20; ++k) {
    exact.run(0.05, 1.0, 1.0);
    const float mean = feed.advance(step, 1.0F);
    sensed = step.sensed * sensed + step.sensed_force * force + step.sensed_input * mean;
    force = step.cut * force + (1.0F - step.cut) * mean;
    worst = std::max({worst, std::abs(static_cast<double>(force) - exact.force),
                      std::abs(static_cast<double>(sensed) - exact.sensed)});
  }
  RecordProperty("worst_ratio", std::to_string(worst));
  EXPECT_LT(worst, 0.05);
  EXPECT_GT(worst, 0.005);
  EXPECT_NEAR(force, 1.0F, 1e-3F);
}

TEST(ForceModel, TakesALagOfZeroForNone) {
  const auto step = LagStep::of(0.05F, 0.0F, 0.1F, 0.0F);
  EXPECT_EQ(step.feed, 0.0F);
  EXPECT_EQ(step.sensed, 0.0F);
  EXPECT_FLOAT_EQ(step.sensed_force, step.cut);  // the estimate is the force
  FeedState feed;
  EXPECT_EQ(feed.advance(step, 0.7F), 0.7F);
  EXPECT_EQ(feed.v, 0.7F);
}

// Two parts of a tick are the tick, and nothing leaves the range of what went in.
TEST(ForceModel, IsOneStepOrManyAndStaysBetweenItsInputsWithoutAllocating) {
  std::mt19937 random(2);
  const auto part = [&random] { return static_cast<float>(random() % 1001) * 1e-3F; };
  const auto allocations = host_tests::allocation_count();
  for (int i = 0; i < 100'000; ++i) {
    const float feed_lag_s = 0.3F * part();
    const float cut_lag_s = 0.05F + 0.3F * part();
    const float length_s = 0.05F * part();
    const auto whole = LagStep::of(0.05F, feed_lag_s, cut_lag_s, 0.03F);
    const auto first = LagStep::of(length_s, feed_lag_s, cut_lag_s, 0.03F);
    const auto second = LagStep::of(0.05F - length_s, feed_lag_s, cut_lag_s, 0.03F);
    const FeedState before{.v = 2.0F * part()};
    const float w = 2.0F * part();
    FeedState at_once = before;
    FeedState in_parts = before;
    const float mean = at_once.advance(whole, w);
    const float mean_1 = in_parts.advance(first, w);
    const float mean_2 = in_parts.advance(second, w);
    ASSERT_NEAR(at_once.v, in_parts.v, 1e-5F);
    ASSERT_NEAR(mean, (length_s * mean_1 + (0.05F - length_s) * mean_2) / 0.05F, 1e-4F);
    ASSERT_GE(mean, std::min(before.v, w) - 1e-4F);
    ASSERT_LE(mean, std::max(before.v, w) + 1e-4F);
    for (const float share : {whole.cut, whole.sensed, whole.sensed_force, whole.sensed_input}) {
      ASSERT_GE(share, -1e-5F) << cut_lag_s;
      ASSERT_LE(share, 1.0F);
    }
  }
  EXPECT_EQ(host_tests::allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::control
