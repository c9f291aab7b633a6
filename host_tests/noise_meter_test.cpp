#include "estimator/noise_meter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "support/allocation_count.hpp"
#include "support/same_bits.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::NoiseMeter;

constexpr double kInertia = 0.03;
constexpr double kTick = 1e-3;

// An idling shaft, sample by sample, with noise on every torque and speed sample.
struct Machine {
  int samples = 5;            // a tick
  double torque_sigma = 0.0;  // of a sample
  double speed_sigma = 0.0;   // of a tick's mean
  double slow_sigma = 0.0;    // of the speed, correlated over slow_s
  double slow_s = 0.02;
  double counts = 0.0;         // encoder, a turn; 0: a continuous speed
  double torque_ripple = 0.0;  // true, at 100 Hz: it moves the shaft
  double load = 0.6;
  std::mt19937 random{51};

  double speed = 157.0;
  double angle = 0.0;
  double counted = 0.0;
  double slow = 0.0;
  double last_torque = 0.6;
  double last_true = 0.6;
  long at = 0;

  NoiseMeter::Input tick(bool idle = true) {
    std::normal_distribution<double> normal;
    const double step = kTick / samples;
    double torque = 0.0;
    double moment = 0.0;
    double sampled = 0.0;
    for (int l = 1; l <= samples; ++l) {
      const double time = static_cast<double>(++at) * step;
      // The drive holds the speed; a slow wander keeps an encoder from one pattern of counts.
      const double is = load + torque_ripple * std::sin(200.0 * std::numbers::pi * time) +
                        0.15 * std::cos(2.0 * time);
      const double seen = is + torque_sigma * normal(random);
      const double trapezoid = 0.5 * (seen + last_torque);
      torque += trapezoid / samples;
      moment += (l - 1) * trapezoid / (samples * samples);
      const double before = speed;
      speed += step * (0.5 * (is + last_true) - load) / kInertia;
      angle += 0.5 * step * (before + speed);
      sampled += speed / samples;
      last_torque = seen;
      last_true = is;
    }
    const double keep = std::exp(-kTick / slow_s);
    slow = keep * slow + slow_sigma * std::sqrt(1.0 - keep * keep) * normal(random);
    double measured = sampled + slow + speed_sigma * normal(random);
    if (counts > 0.0) {
      const double now = std::floor(angle * counts / (2.0 * std::numbers::pi));
      measured = (now - counted) * 2.0 * std::numbers::pi / counts / kTick;
      counted = now;
    }
    return {.torque_nm = static_cast<float>(torque),
            .moment_nm = static_cast<float>(moment),
            .speed_rad_s = static_cast<float>(measured),
            .duration_s = static_cast<float>(kTick),
            .inertia_kg_m2 = static_cast<float>(kInertia),
            .idle = idle,
            .calibrated = true};
  }
};

NoiseMeter meter_at(int samples, bool sensorless = false) {
  return NoiseMeter({.sample_period_s = static_cast<float>(kTick / samples),
                     .rated_torque_nm = 14.6F,
                     .sensorless = sensorless});
}

NoiseMeter settled(Machine& machine, int ticks = 2000) {
  auto meter = meter_at(machine.samples);
  for (int k = 0; k < ticks; ++k) meter.step(machine.tick());
  return meter;
}

TEST(NoiseMeter, FindsWhiteSpeedNoise) {
  for (const double sigma : {0.01, 0.05, 0.2}) {
    Machine machine{.torque_sigma = 0.02, .speed_sigma = sigma};
    const auto noise = settled(machine).noise();
    EXPECT_NEAR(noise.speed_variance, sigma * sigma, 0.25 * sigma * sigma) << sigma;
    EXPECT_EQ(noise.angle_variance, 0.0F) << sigma;
  }
}

TEST(NoiseMeter, FindsTheCountsOfAnEncoder) {
  for (const double counts : {1024.0, 4096.0}) {
    Machine machine{.torque_sigma = 0.02, .counts = counts};
    const auto meter = settled(machine);
    const double quantum = 2.0 * std::numbers::pi / counts / kTick;
    EXPECT_TRUE(meter.counts()) << counts;
    // A sixth of the scatter of the changes, but never below the variance of one rounding.
    EXPECT_GE(meter.noise().angle_variance, 0.99 * quantum * quantum / 12.0) << counts;
    EXPECT_LE(meter.noise().angle_variance, 1.35 * quantum * quantum / 12.0) << counts;
    EXPECT_LT(meter.noise().speed_variance, 1e-6F) << counts;
  }
}

// So fine that the quantum is not looked for: the differences tell noise of an angle from noise of
// a speed all the same.
TEST(NoiseMeter, FindsTheNoiseOfAFineEncoderAsOneOfAnAngle) {
  Machine machine{.torque_sigma = 0.02, .counts = 65536.0};
  const auto noise = settled(machine).noise();
  const double quantum = 2.0 * std::numbers::pi / 65536.0 / kTick;
  EXPECT_NEAR(noise.angle_variance, quantum * quantum / 12.0, 0.35 * quantum * quantum / 12.0);
  EXPECT_LT(noise.speed_variance, 0.5F * noise.angle_variance);
}

// What wanders over some ticks hardly shows from one to the next; the lagged difference sees it.
TEST(NoiseMeter, CountsSlowNoiseOfTheSpeedAsNoise) {
  Machine machine{.torque_sigma = 0.02, .speed_sigma = 0.005, .slow_sigma = 0.06, .slow_s = 0.005};
  const auto noise = settled(machine, 4000).noise();
  EXPECT_GT(noise.speed_variance, 0.4 * 0.06 * 0.06);
  EXPECT_LT(noise.speed_variance, 1.6 * 0.06 * 0.06);
}

// R_T is what white noise of the samples gives at low frequency: sigma^2/n.
TEST(NoiseMeter, FindsTheNoiseOfTheTorqueWhateverTheSampleRate) {
  for (const int samples : {1, 2, 5, 20}) {
    for (const double speed_sigma : {0.0, 0.05}) {
      Machine machine{.samples = samples, .torque_sigma = 0.1, .speed_sigma = speed_sigma};
      const double expected = 0.01 / samples;
      EXPECT_NEAR(settled(machine, 4000).noise().torque_variance, expected, 0.25 * expected)
          << samples << ' ' << speed_sigma;
    }
  }
}

// A true ripple of the torque moves the shaft, so it is no noise, as far as the speed shows it.
TEST(NoiseMeter, DoesNotTakeTrueTorqueRippleForNoise) {
  Machine machine{.torque_sigma = 0.01, .speed_sigma = 1e-4, .torque_ripple = 1.0};
  EXPECT_LT(settled(machine, 4000).noise().torque_variance, 5e-4F);
}

TEST(NoiseMeter, HardlyNoticesATransient) {
  Machine machine{.torque_sigma = 0.02, .speed_sigma = 0.05};
  auto meter = settled(machine);
  const float before = meter.noise().speed_variance;
  machine.speed_sigma = 2.0;
  for (int k = 0; k < 20; ++k) meter.step(machine.tick());
  machine.speed_sigma = 0.05;
  for (int k = 0; k < 150; ++k) meter.step(machine.tick());
  EXPECT_LT(meter.noise().speed_variance, 1.6F * before);
  for (int k = 0; k < 1500; ++k) meter.step(machine.tick());
  EXPECT_NEAR(meter.noise().speed_variance, 2.5e-3, 0.3 * 2.5e-3);
}

TEST(NoiseMeter, ForgetsATransientThatItBeganWith) {
  Machine machine{.torque_sigma = 0.02, .speed_sigma = 3.0};
  auto meter = meter_at(machine.samples);
  for (int k = 0; k < 120; ++k) meter.step(machine.tick());
  machine.speed_sigma = 0.05;
  for (int k = 0; k < 300; ++k) meter.step(machine.tick());
  EXPECT_NEAR(meter.noise().speed_variance, 2.5e-3, 0.4 * 2.5e-3);
}

// In the cut the load moves the speed: only the torque's own noise is followed there.
TEST(NoiseMeter, FollowsOnlyTheTorqueInTheCut) {
  Machine machine{.torque_sigma = 0.02, .speed_sigma = 0.05};
  auto meter = settled(machine);
  const float before = meter.noise().speed_variance;
  machine.torque_sigma = 0.1;
  machine.speed_sigma = 0.5;
  for (int k = 0; k < 3000; ++k) meter.step(machine.tick(false));
  EXPECT_EQ(meter.noise().speed_variance, before);
  EXPECT_GT(meter.noise().torque_variance, 5.0 * 4e-4 / 5.0);
}

TEST(NoiseMeter, StartsWithAGuessAndKeepsWhatItKnowsOverARestart) {
  auto meter = meter_at(5);
  EXPECT_GT(meter.noise().speed_variance, 0.0F);
  EXPECT_GT(meter.noise().torque_variance, 0.0F);
  Machine machine{.torque_sigma = 0.02, .speed_sigma = 0.05};
  meter = settled(machine);
  const auto known = meter.noise();
  meter.restart();
  for (int k = 0; k < 10; ++k) meter.step(machine.tick());
  EXPECT_NEAR(meter.noise().speed_variance, known.speed_variance, 1e-6F);
}

TEST(NoiseMeter, CallsTheNoiseOfAFluxAngleWhite) {
  Machine machine{.torque_sigma = 0.02, .counts = 65536.0};
  auto meter = meter_at(5, true);
  for (int k = 0; k < 2000; ++k) meter.step(machine.tick());
  EXPECT_EQ(meter.noise().angle_variance, 0.0F);
  EXPECT_FALSE(meter.counts());
  EXPECT_GT(meter.noise().speed_variance, 0.0F);
}

TEST(NoiseMeter, KeepsItsVariancesPositiveAndFiniteUnderRandomInput) {
  std::mt19937 random(52);
  std::uniform_real_distribution<float> draw(-1.0F, 1.0F);
  for (const bool sensorless : {false, true}) {
    auto meter = meter_at(5, sensorless);
    for (int k = 0; k < 200'000; ++k) {
      const float scale = std::pow(10.0F, 3.0F * draw(random));
      meter.step({.torque_nm = scale * draw(random),
                  .moment_nm = scale * draw(random),
                  .speed_rad_s = k % 1000 < 300 ? 6.0F * std::round(5.0F * draw(random))
                                                : scale * draw(random),
                  .duration_s = 1e-3F * (1.1F + draw(random)),
                  .inertia_kg_m2 = 0.03F,
                  .idle = draw(random) > 0.0F,
                  .calibrated = k > 100});
      if (k % 977 == 0) meter.restart();
      const auto noise = meter.noise();
      ASSERT_TRUE(noise.speed_variance > 0.0F && noise.speed_variance < 1e12F) << k;
      ASSERT_TRUE(noise.angle_variance >= 0.0F && noise.angle_variance < 1e12F) << k;
      ASSERT_TRUE(noise.torque_variance >= 0.0F && noise.torque_variance < 1e12F) << k;
    }
  }
}

TEST(NoiseMeter, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  Machine machine{.torque_sigma = 0.02, .speed_sigma = 0.05};
  auto original = meter_at(5);
  auto resumed = meter_at(5);
  const auto allocations = allocation_count();
  for (int k = 0; k < 1000; ++k) {
    resumed.restore(original.state());
    const auto input = machine.tick(k < 600);
    original.step(input);
    resumed.step(input);
    ASSERT_TRUE(same_bits(original.state(), resumed.state())) << k;
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
