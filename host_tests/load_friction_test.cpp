#include "estimator/load_friction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>

#include "support/allocation_count.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::LoadFriction;
using estimator::SpeedTable;

constexpr LoadFriction::Config kLathe{
    .linear_ratio = {.speed_rad_s = {50.0F, 105.0F, 200.0F}, .value = {0.05F, 0.06F, 0.07F}},
    .quadratic_1_nm = {.speed_rad_s = {50.0F, 105.0F, 200.0F}, .value = {0.001F, 0.0015F, 0.0F}}};
static_assert(kLathe.check());

TEST(LoadFriction, InvertsP3InSingleAndDoublePrecision) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> draw(0.0, 1.0);
  for (int k = 0; k < 10000; ++k) {
    const double cutting = -20.0 + 80.0 * draw(random);
    const double f = 0.3 * draw(random);
    const double g = k % 3 == 0 ? 0.0 : 0.01 * draw(random);
    const double torque = estimator::torque_with_load_friction(cutting, f, g);
    EXPECT_NEAR(estimator::torque_without_load_friction(torque, f, g), cutting,
                1e-12 * std::max(1.0, std::abs(cutting)));
    const float single = estimator::torque_without_load_friction(
        static_cast<float>(torque), static_cast<float>(f), static_cast<float>(g));
    EXPECT_NEAR(static_cast<double>(single), cutting, 1e-6 * std::max(1.0, std::abs(cutting)));
  }
}

TEST(LoadFriction, ReadsItsTablesOverSpeedInBothDirections) {
  const auto friction = LoadFriction::make(kLathe).value();
  const auto cutting = [&](float speed) {
    return friction.step({.torque_nm = 12.0F, .speed_rad_s = speed}).cutting_torque_nm;
  };
  const float middle = estimator::torque_without_load_friction(12.0F, 0.055F, 0.00125F);
  EXPECT_NEAR(cutting(77.5F), middle, 1e-5F);
  EXPECT_EQ(cutting(-77.5F), cutting(77.5F));
  EXPECT_EQ(cutting(10.0F), cutting(50.0F));
  EXPECT_NEAR(cutting(500.0F), 12.0F / 1.07F, 1e-5F);
}

// Noise in the air cut has mean zero and must keep it.
TEST(LoadFriction, IsOddAndItsSensitivityIsItsDerivative) {
  const auto friction = LoadFriction::make(kLathe).value();
  for (float torque = -15.0F; torque <= 15.0F; torque += 0.7F) {
    const auto at = [&](float t) { return friction.step({.torque_nm = t, .speed_rad_s = 90.0F}); };
    EXPECT_EQ(at(-torque).cutting_torque_nm, -at(torque).cutting_torque_nm);
    const float slope =
        (at(torque + 0.05F).cutting_torque_nm - at(torque - 0.05F).cutting_torque_nm) / 0.1F;
    EXPECT_NEAR(at(torque).sensitivity_ratio, slope, 1e-3F);
  }
}

TEST(LoadFriction, RefusesWhatItCannotWorkWith) {
  using Error = LoadFriction::ConfigError;
  const auto refused = [](auto change) {
    auto config = kLathe;
    change(config);
    const auto made = LoadFriction::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.linear_ratio.speed_rad_s[1] = 50.0F; }), Error::kSpeeds);
  EXPECT_EQ(refused([](auto& c) { c.quadratic_1_nm.speed_rad_s[2] = NAN; }), Error::kSpeeds);
  EXPECT_EQ(refused([](auto& c) { c.linear_ratio.speed_rad_s[0] = -1.0F; }), Error::kSpeeds);
  EXPECT_EQ(refused([](auto& c) { c.linear_ratio.value[0] = -1.0F; }), Error::kLinear);
  EXPECT_EQ(refused([](auto& c) { c.linear_ratio.value[2] = NAN; }), Error::kLinear);
  EXPECT_EQ(refused([](auto& c) { c.quadratic_1_nm.value[1] = -1e-6F; }), Error::kQuadratic);
}

TEST(LoadFriction, AllocatesNothing) {
  const auto friction = LoadFriction::make(kLathe).value();
  const auto allocations = allocation_count();
  (void)friction.step({.torque_nm = 3.0F, .speed_rad_s = 90.0F});
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
