#include "estimator/cutting_force.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>

#include "support/allocation_count.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::CuttingForce;

constexpr CuttingForce::Config kLathe{
    .gear_ratio = 2.0F, .minimum_speed_rad_s = 5.0F, .diameter_sigma_m = 0.0005F};
static_assert(kLathe.check());

TEST(CuttingForce, FollowsFromTorqueGearAndTheDiameterOfNow) {
  const auto force = CuttingForce::make(kLathe).value();
  // Facing: the diameter shrinks at a constant torque.
  for (const float diameter : {0.2F, 0.1F, 0.05F, 0.01F}) {
    const auto output = force.step({.cutting_torque_nm = 5.0F,
                                    .cutting_torque_sigma_nm = 0.1F,
                                    .speed_rad_s = 100.0F,
                                    .diameter_m = diameter});
    EXPECT_EQ(output.status, CuttingForce::Status::kForce);
    EXPECT_NEAR(output.force_n, 20.0F / diameter, 1e-3F);
  }
}

TEST(CuttingForce, IsTheSameInBothDirectionsOfRotation) {
  const auto force = CuttingForce::make(kLathe).value();
  for (const float direction : {1.0F, -1.0F}) {
    const auto output = force.step({.cutting_torque_nm = 5.0F * direction,
                                    .cutting_torque_sigma_nm = 0.1F,
                                    .speed_rad_s = 100.0F * direction,
                                    .diameter_m = 0.05F});
    EXPECT_NEAR(output.force_n, 400.0F, 1e-3F);
  }
}

TEST(CuttingForce, SaysWhyThereIsNoEstimate) {
  const auto force = CuttingForce::make(kLathe).value();
  const auto status = [&](float speed, float diameter) {
    const auto output = force.step({.cutting_torque_nm = 5.0F,
                                    .cutting_torque_sigma_nm = 0.1F,
                                    .speed_rad_s = speed,
                                    .diameter_m = diameter});
    EXPECT_TRUE(std::isfinite(output.force_n) && std::isfinite(output.force_sigma_n));
    return output.status;
  };
  EXPECT_EQ(status(4.9F, 0.05F), CuttingForce::Status::kBelowMinimumSpeed);
  EXPECT_EQ(status(-4.9F, 0.05F), CuttingForce::Status::kBelowMinimumSpeed);
  EXPECT_EQ(status(NAN, 0.05F), CuttingForce::Status::kBelowMinimumSpeed);
  EXPECT_EQ(status(100.0F, 0.0F), CuttingForce::Status::kNoDiameter);
  EXPECT_EQ(status(100.0F, -0.05F), CuttingForce::Status::kNoDiameter);
  EXPECT_EQ(status(100.0F, NAN), CuttingForce::Status::kNoDiameter);
}

// Sigma against the scatter of many draws of torque and diameter.
TEST(CuttingForce, PropagatesTheUncertaintyOfTorqueAndDiameter) {
  auto config = kLathe;
  config.diameter_sigma_m = 0.001F;
  const auto force = CuttingForce::make(config).value();
  std::mt19937 random(7);
  std::normal_distribution<float> normal;
  const auto at = [&](float torque, float diameter) {
    return force.step({.cutting_torque_nm = torque,
                       .cutting_torque_sigma_nm = 0.1F,
                       .speed_rad_s = 100.0F,
                       .diameter_m = diameter});
  };
  const auto stated = at(5.0F, 0.05F);
  double square = 0.0;
  constexpr int kDraws = 20000;
  for (int k = 0; k < kDraws; ++k) {
    const float error =
        at(5.0F + 0.1F * normal(random), 0.05F + 0.001F * normal(random)).force_n - stated.force_n;
    square += static_cast<double>(error * error);
  }
  EXPECT_NEAR(std::sqrt(square / kDraws) / static_cast<double>(stated.force_sigma_n), 1.0, 0.03);
}

TEST(CuttingForce, RefusesWhatItCannotWorkWithAndAllocatesNothing) {
  using Error = CuttingForce::ConfigError;
  const auto refused = [](auto change) {
    auto config = kLathe;
    change(config);
    const auto made = CuttingForce::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.gear_ratio = 0.0F; }), Error::kGearRatio);
  EXPECT_EQ(refused([](auto& c) { c.gear_ratio = NAN; }), Error::kGearRatio);
  EXPECT_EQ(refused([](auto& c) { c.minimum_speed_rad_s = 0.0F; }), Error::kMinimumSpeed);
  EXPECT_EQ(refused([](auto& c) { c.diameter_sigma_m = NAN; }), Error::kDiameterSigma);
  const auto force = CuttingForce::make(kLathe).value();
  const auto allocations = allocation_count();
  (void)force.step({.cutting_torque_nm = 5.0F,
                    .cutting_torque_sigma_nm = 0.1F,
                    .speed_rad_s = 100.0F,
                    .diameter_m = 0.05F});
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
