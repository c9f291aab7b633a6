#include "estimator/power_scale.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <optional>
#include <random>

#include "support/allocation_count.hpp"
#include "support/same_bits.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::PowerScale;

constexpr PowerScale::Config kMeter{.lag_s = 0.3F,
                                    .rated_power_w = 2200.0F,
                                    .gain_sigma_ratio = 0.02F,
                                    .meter_sigma_ratio = 0.004F,
                                    .implausible_ratio = 0.1F};
static_assert(kMeter.check());

// The drive's meter: true power behind a first-order lag, and its noise.
struct Drive {
  double scale = 1.0;  // true power over computed
  double lag = 0.3;
  double noise_w = 0.0;
  double reading = 0.0;
  std::mt19937 random{71};

  double read(double computed_w) {
    std::normal_distribution<double> normal;
    reading += 1e-3 / lag * (scale * computed_w - reading);
    return reading + noise_w * normal(random);
  }
};

double power_at(int k) { return (k / 2000) % 2 == 0 ? 900.0 : 1800.0; }

PowerScale run(Drive drive, int ticks) {
  auto block = PowerScale::make(kMeter).value();
  for (int k = 0; k < ticks; ++k) {
    const double power = power_at(k);
    block.step(static_cast<float>(power), static_cast<float>(drive.read(power)), 1e-3F);
  }
  return block;
}

// What is left is no more than the meter's own uncertainty.
TEST(PowerScale, FindsACommonGainErrorUpToTheMetersOwn) {
  for (const double scale : {0.96, 0.98, 1.02, 1.04}) {
    const auto block = run({.scale = scale, .noise_w = 5.0}, 8000);
    EXPECT_NEAR(block.gain_ratio(), scale, 0.004) << scale;
    EXPECT_NEAR(block.state().gain, scale, 0.001) << scale;
  }
}

TEST(PowerScale, LeavesAGainAloneThatIsRight) {
  EXPECT_EQ(run({.noise_w = 5.0}, 8000).gain_ratio(), 1.0F);
  EXPECT_EQ(run({.scale = 1.001, .noise_w = 5.0}, 8000).gain_ratio(), 1.0F);
}

// A lag wrong by a quarter must not pass for a scale: it is weighed down while the power moves.
TEST(PowerScale, IsHardlyMisledByAWrongLag) {
  for (const double lag : {0.225, 0.375}) {
    EXPECT_NEAR(run({.scale = 1.02, .lag = lag, .noise_w = 5.0}, 8000).gain_ratio(), 1.02, 0.006)
        << lag;
  }
}

TEST(PowerScale, DoesNotBelieveAMeterThatIsFarOff) {
  EXPECT_EQ(run({.scale = 1.3}, 8000).gain_ratio(), 1.0F);
  EXPECT_EQ(run({.scale = 0.5}, 8000).gain_ratio(), 1.0F);
}

TEST(PowerScale, DoesNotJudgeByLittleOrNegativePower) {
  auto block = PowerScale::make(kMeter).value();
  for (int k = 0; k < 5000; ++k) block.step(k < 2500 ? 100.0F : -1500.0F, 106.0F, 1e-3F);
  EXPECT_EQ(block.gain_ratio(), 1.0F);
}

TEST(PowerScale, RefusesWhatItCannotWorkWith) {
  using Error = PowerScale::ConfigError;
  const auto refused = [](auto change) {
    auto config = kMeter;
    change(config);
    const auto made = PowerScale::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.lag_s = 0.0F; }), Error::kLag);
  EXPECT_EQ(refused([](auto& c) { c.rated_power_w = NAN; }), Error::kPower);
  EXPECT_EQ(refused([](auto& c) { c.gain_sigma_ratio = -0.1F; }), Error::kUncertainty);
  EXPECT_EQ(refused([](auto& c) { c.meter_sigma_ratio = 0.0F; }), Error::kUncertainty);
  EXPECT_EQ(refused([](auto& c) { c.implausible_ratio = NAN; }), Error::kUncertainty);
  EXPECT_EQ(refused([](auto&) {}), std::nullopt);
}

TEST(PowerScale, StaysPlausibleWhateverTheMeterReads) {
  std::mt19937 random(72);
  std::uniform_real_distribution<float> draw(-1.0F, 1.0F);
  auto block = PowerScale::make(kMeter).value();
  for (int k = 0; k < 200'000; ++k) {
    block.step(4000.0F * draw(random), 4000.0F * draw(random), 1e-3F * (1.1F + draw(random)));
    ASSERT_TRUE(block.gain_ratio() > 0.9F && block.gain_ratio() < 1.1F) << k;
    ASSERT_TRUE(block.state().variance > 0.0F) << k;
  }
}

TEST(PowerScale, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  Drive drive{.scale = 1.02, .noise_w = 5.0};
  auto original = PowerScale::make(kMeter).value();
  auto resumed = original;
  const auto allocations = allocation_count();
  for (int k = 0; k < 3000; ++k) {
    resumed.restore(original.state());
    const auto power = static_cast<float>(power_at(k));
    const auto reading = static_cast<float>(drive.read(power_at(k)));
    original.step(power, reading, 1e-3F);
    resumed.step(power, reading, 1e-3F);
    ASSERT_TRUE(same_bits(original.state(), resumed.state())) << k;
  }
  EXPECT_EQ(allocation_count(), allocations);
}

// Evaluated by the compiler: 2 % too little power computed, and a meter without error.
constexpr float settled_gain() {
  auto block = *PowerScale::make(kMeter);
  for (int k = 0; k < 3000; ++k) block.step(1000.0F, 1020.0F, 1e-3F);
  return block.state().gain;
}
static_assert(settled_gain() > 1.019F && settled_gain() < 1.021F);

}  // namespace
}  // namespace cutforce::host_tests
