#include "estimator/speed_ripple.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>

#include "support/allocation_count.hpp"
#include "support/same_bits.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::SpeedRipple;

constexpr double kTick = 1e-3;

// A shaft with an eccentric encoder: error of the speed once and twice a turn, and noise.
struct Eccentric {
  double speed = 157.0;
  double once = 0.0;
  double twice = 0.0;
  double noise = 0.0;
  double angle = 0.0;
  std::mt19937 random{31};

  double tick() {
    angle += speed * kTick;
    std::normal_distribution<double> normal;
    return once * std::cos(angle - 0.8) + twice * std::sin(2.0 * angle + 0.3) +
           noise * normal(random);
  }
};

struct Run {
  double raw;        // root mean square of the true error in the last second
  double remaining;  // of what is left of it
};

// Idle for `idle_s`, then a cut of one second in which nothing is learned.
Run learn_then_cut(Eccentric shaft, double idle_s, SpeedRipple& ripple) {
  double raw = 0.0;
  double remaining = 0.0;
  const int idle = static_cast<int>(idle_s / kTick);
  for (int k = 0; k < idle + 1000; ++k) {
    const double noisy = shaft.tick();
    const double truth =
        shaft.once * std::cos(shaft.angle - 0.8) + shaft.twice * std::sin(2.0 * shaft.angle + 0.3);
    const auto error = static_cast<double>(
        ripple.step(static_cast<float>(shaft.speed + noisy), static_cast<float>(kTick)));
    if (k < idle) {
      ripple.learn(static_cast<float>(noisy), static_cast<float>(kTick));
    } else {
      raw += truth * truth;
      remaining += (truth - error) * (truth - error);
    }
  }
  return {std::sqrt(raw / 1000.0), std::sqrt(remaining / 1000.0)};
}

TEST(SpeedRipple, LearnsAnEccentricityInIdleAndTakesItOffInTheCut) {
  for (const double speed : {31.0, 157.0, -157.0}) {
    SpeedRipple ripple;
    const auto run =
        learn_then_cut({.speed = speed, .once = 0.35, .twice = 0.1, .noise = 0.02}, 2.5, ripple);
    EXPECT_TRUE(ripple.applies()) << speed;
    EXPECT_LT(run.remaining, 0.1 * run.raw) << speed;
  }
}

TEST(SpeedRipple, StaysOffWithoutOne) {
  for (std::uint32_t seed = 1; seed <= 50; ++seed) {
    SpeedRipple ripple;
    Eccentric shaft{.noise = 0.05};
    shaft.random.seed(seed);
    for (int k = 0; k < 4000; ++k) {
      const auto noisy = static_cast<float>(shaft.tick());
      ASSERT_EQ(ripple.step(157.0F + noisy, 1e-3F), 0.0F) << seed << ' ' << k;
      ripple.learn(noisy, 1e-3F);
    }
  }
}

// One that noise hides is no loss: it must not be made worse.
TEST(SpeedRipple, NeverMakesASmallOneWorse) {
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    for (const double once : {0.005, 0.02, 0.05, 0.1}) {
      SpeedRipple ripple;
      Eccentric shaft{.once = once, .noise = 0.05};
      shaft.random.seed(seed);
      const auto run = learn_then_cut(shaft, 3.0, ripple);
      EXPECT_LE(run.remaining, run.raw + 1e-9) << seed << ' ' << once;
    }
  }
}

TEST(SpeedRipple, IsNotAppliedBeforeHalfASecondOfLearning) {
  SpeedRipple ripple;
  Eccentric shaft{.once = 0.35};
  for (int k = 0; k < 490; ++k) {
    const auto error = static_cast<float>(shaft.tick());
    EXPECT_EQ(ripple.step(157.0F, 1e-3F), 0.0F);
    ripple.learn(error, 1e-3F);
  }
  EXPECT_FALSE(ripple.applies());
}

TEST(SpeedRipple, ForgetsWithTheShaftAngle) {
  SpeedRipple ripple;
  static_cast<void>(learn_then_cut({.once = 0.35}, 2.0, ripple));
  ASSERT_TRUE(ripple.applies());
  ripple.forget();
  EXPECT_FALSE(ripple.applies());
  EXPECT_EQ(ripple.step(157.0F, 1e-3F), 0.0F);
}

TEST(SpeedRipple, LearnsNothingLargerThanItIsTold) {
  SpeedRipple ripple;
  std::mt19937 random(32);
  std::uniform_real_distribution<float> draw(-1500.0F, 1500.0F);
  for (int k = 0; k < 1'000'000; ++k) {
    static_cast<void>(ripple.step(draw(random), 1e-3F));  // beyond 0.8 rad a tick it stands still
    if (k % 3 == 0) ripple.learn(1e-3F * draw(random), 1e-3F);
  }
  const auto& s = ripple.state();
  for (const float a : s.amplitude_rad_s) EXPECT_LT(std::abs(a), 2.0F);
}

TEST(SpeedRipple, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  SpeedRipple original;
  SpeedRipple resumed;
  Eccentric shaft{.once = 0.35, .noise = 0.02};
  const auto allocations = allocation_count();
  for (int k = 0; k < 2000; ++k) {
    resumed.restore(original.state());
    const auto error = static_cast<float>(shaft.tick());
    ASSERT_EQ(original.step(157.0F + error, 1e-3F), resumed.step(157.0F + error, 1e-3F)) << k;
    original.learn(error, 1e-3F);
    resumed.learn(error, 1e-3F);
    ASSERT_TRUE(same_bits(original.state(), resumed.state())) << k;
  }
  EXPECT_EQ(allocation_count(), allocations);
}

// Known to the compiler too: a shaft that turns by a quarter in a hundred ticks, and back by whole
// turns, which an angle of 32 bits counts without an error that gathers.
constexpr std::uint32_t turned_by(float speed_rad_s, int ticks) {
  SpeedRipple ripple;
  for (int k = 0; k < ticks; ++k) static_cast<void>(ripple.step(speed_rad_s, 1e-3F));
  return ripple.state().turn;
}
constexpr bool near_turn(std::uint32_t turn, std::uint32_t wanted) {
  return turn - wanted < 40'000U || wanted - turn < 40'000U;  // 6e-5 rad
}
static_assert(near_turn(turned_by(15.7079633F, 100), 1U << 30U));
static_assert(near_turn(turned_by(-15.7079633F, 100), 3U << 30U));
static_assert(near_turn(turned_by(-157.079633F, 1000), 0U));

}  // namespace
}  // namespace cutforce::host_tests
