#include "estimator/measured_power.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>

#include "support/allocation_count.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::MeasuredPower;

constexpr MeasuredPower::Config kMeter{
    .period_s = 0.05F,
    .scale_ratio = 2.0F,
    .offset_w = 50.0F,
    .efficiency_ratio = 0.95F,
    .loss_w = {.speed_rad_s = {0.0F, 100.0F, 200.0F}, .value = {40.0F, 60.0F, 100.0F}},
    .loss_quadratic_1_w = 1e-5F,
    .lag_s = 0.3F,
    .noise_w = 5.0F,
    .model_sigma_ratio = 0.02F,
    .bias_memory_s = 0.15F,
    .settled_w = 80.0F};
static_assert(kMeter.check());

TEST(MeasuredPower, AppliesScaleOffsetEfficiencyAndLossMap) {
  auto meter = MeasuredPower::make(kMeter).value();
  const auto output = meter.step({.meter_w = 1050.0F, .speed_rad_s = 150.0F});
  EXPECT_NEAR(output.power_w, 0.95F * 2000.0F - 80.0F - 1e-5F * 4e6F, 1e-3F);
  EXPECT_NEAR(output.sigma_w, std::hypot(5.0F, 0.02F * output.power_w), 1e-3F);
  EXPECT_EQ(meter.lag_s(), 0.3F);
}

// Behind a first-order lag the reading is off by lag times its slope: sigma covers it without
// being much too wide.
TEST(MeasuredPower, CountsItsLagAsUncertainty) {
  auto config = kMeter;
  config.scale_ratio = 1.0F;
  config.offset_w = 0.0F;
  config.efficiency_ratio = 1.0F;
  config.loss_w.value = {0.0F, 0.0F, 0.0F};
  config.loss_quadratic_1_w = 0.0F;
  config.noise_w = 0.0F;
  config.model_sigma_ratio = 0.0F;
  auto meter = MeasuredPower::make(config).value();
  (void)meter.step({.meter_w = 0.0F, .speed_rad_s = 100.0F});
  for (int k = 1; k < 40; ++k) {
    const float reading = 1000.0F * (1.0F - std::exp(-0.05F * static_cast<float>(k) / 0.3F));
    const auto output = meter.step({.meter_w = reading, .speed_rad_s = 100.0F});
    const float error = 1000.0F - output.power_w;
    EXPECT_GE(output.sigma_w, error * 0.99F);
    EXPECT_LE(output.sigma_w, error * 1.2F);
  }
}

TEST(MeasuredPower, LearnsItsIdleBiasOnlyWhenTheReadingHasSettled) {
  auto meter = MeasuredPower::make(kMeter).value();
  // 1 kW of cutting leaves the meter slowly; the air gap shows 100 W at once.
  float reading = 1000.0F;
  for (int k = 0; k < 40; ++k) (void)meter.step({.meter_w = reading, .speed_rad_s = 100.0F});
  for (int k = 0; k < 100; ++k) {
    reading += (150.0F - reading) * 0.05F / 0.35F;
    (void)meter.step({.meter_w = reading, .speed_rad_s = 100.0F});
    meter.calibrate(100.0F);
    if (k < 10) {
      EXPECT_EQ(meter.state().bias_w, 0.0F) << k;
    }
  }
  EXPECT_NEAR(meter.step({.meter_w = reading, .speed_rad_s = 100.0F}).power_w, 100.0F, 0.01F);
}

TEST(MeasuredPower, RefusesWhatItCannotWorkWith) {
  using Error = MeasuredPower::ConfigError;
  const auto refused = [](auto change) {
    auto config = kMeter;
    change(config);
    const auto made = MeasuredPower::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.period_s = NAN; }), Error::kPeriod);
  EXPECT_EQ(refused([](auto& c) { c.scale_ratio = 0.0F; }), Error::kScale);
  EXPECT_EQ(refused([](auto& c) { c.offset_w = NAN; }), Error::kScale);
  EXPECT_EQ(refused([](auto& c) { c.efficiency_ratio = 0.0F; }), Error::kLoss);
  EXPECT_EQ(refused([](auto& c) { c.loss_w.value[1] = NAN; }), Error::kLoss);
  EXPECT_EQ(refused([](auto& c) { c.loss_w.speed_rad_s[2] = 50.0F; }), Error::kLoss);
  EXPECT_EQ(refused([](auto& c) { c.lag_s = -0.1F; }), Error::kLag);
  EXPECT_EQ(refused([](auto& c) { c.noise_w = NAN; }), Error::kNoise);
  EXPECT_EQ(refused([](auto& c) { c.bias_memory_s = 0.0F; }), Error::kMemory);
}

TEST(MeasuredPower, ContinuesFromASnapshotWithoutAllocating) {
  std::mt19937 random(9);
  std::uniform_real_distribution<float> draw(0.0F, 2000.0F);
  auto original = MeasuredPower::make(kMeter).value();
  auto resumed = original;
  const auto allocations = allocation_count();
  for (int k = 0; k < 1000; ++k) {
    const MeasuredPower::Input input{.meter_w = draw(random), .speed_rad_s = 120.0F};
    resumed.restore(original.state());
    const auto a = original.step(input);
    const auto b = resumed.step(input);
    original.calibrate(500.0F);
    EXPECT_EQ(a.power_w, b.power_w);
    EXPECT_EQ(a.sigma_w, b.sigma_w);
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
