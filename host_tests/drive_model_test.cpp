#include "estimator/drive_model.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>

#include "support/allocation_count.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::DriveModel;

constexpr DriveModel::Config kLathe{.period_s = 0.05F, .inertia_kg_m2 = 0.12F};
constexpr double kViscous = 0.02;
static_assert(kLathe.check());

// The exact motion of (J, B) under a torque that is constant within a window.
struct Spindle {
  double speed_rad_s;
  void run(double torque_nm, double viscous, double period_s) {
    const double keep = std::exp(-viscous * period_s / 0.12);
    speed_rad_s = keep * speed_rad_s + (1.0 - keep) / viscous * torque_nm;
  }
};

// P3 (6) with the corrected index: steps of 10 N m, J = 0.12, B = 0.02.
TEST(DriveModel, FindsTheLoadExactlyWhateverItsSteps) {
  auto drive = DriveModel::make(kLathe).value();
  Spindle spindle{.speed_rad_s = 105.0};
  (void)drive.step({.airgap_torque_nm = 0.0F,
                    .speed_rad_s = static_cast<float>(spindle.speed_rad_s),
                    .viscous_nm_s_rad = static_cast<float>(kViscous)});
  double square = 0.0;
  for (int k = 0; k < 200; ++k) {
    const double load_nm = (k / 10) % 2 == 0 ? 0.0 : 10.0;
    // A speed loop that lags: the speed really moves.
    const double motor_nm =
        2.0 + load_nm * (k % 10 < 2 ? 0.5 : 1.0) + 0.5 * (105.0 - spindle.speed_rad_s);
    spindle.run(motor_nm - load_nm, kViscous, 0.05);
    const auto output = drive.step({.airgap_torque_nm = static_cast<float>(motor_nm),
                                    .speed_rad_s = static_cast<float>(spindle.speed_rad_s),
                                    .viscous_nm_s_rad = static_cast<float>(kViscous)});
    const double error = static_cast<double>(output.external_torque_nm) - load_nm;
    EXPECT_LT(std::abs(error), 0.01) << k;
    square += error * error;
  }
  EXPECT_LT(std::sqrt(square / 200.0), 0.001);
}

// The series of 1/b against the formula, up to B h/J = 1 and down to no friction at all.
TEST(DriveModel, KnowsItsGainWithoutAnExponential) {
  const auto drive = DriveModel::make(kLathe).value();
  for (double x = 1e-6; x <= 1.0; x *= 1.1) {
    const double viscous = x * 0.12 / 0.05;
    const double expected = viscous / -std::expm1(-x);
    EXPECT_NEAR(static_cast<double>(drive.gain(static_cast<float>(viscous))), expected,
                1e-6 * expected);
  }
  EXPECT_EQ(drive.gain(0.0F), 0.12F / 0.05F);
}

TEST(DriveModel, NeedsNoFriction) {
  auto drive = DriveModel::make(kLathe).value();
  (void)drive.step({.airgap_torque_nm = 5.0F, .speed_rad_s = 100.0F, .viscous_nm_s_rad = 0.0F});
  const auto output =
      drive.step({.airgap_torque_nm = 5.0F, .speed_rad_s = 101.0F, .viscous_nm_s_rad = 0.0F});
  EXPECT_NEAR(output.external_torque_nm, 5.0F - 2.4F, 1e-6F);
  EXPECT_EQ(output.external_torque_nm, output.load_torque_nm);
  EXPECT_NEAR(output.inertia_torque_nm, 2.4F, 1e-6F);
}

TEST(DriveModel, HasNoInertiaPartInItsFirstWindow) {
  auto drive = DriveModel::make(kLathe).value();
  for (int k = 0; k < 2; ++k) {
    const auto output =
        drive.step({.airgap_torque_nm = 5.0F, .speed_rad_s = 100.0F, .viscous_nm_s_rad = 0.01F});
    EXPECT_NEAR(output.external_torque_nm, 4.0F, 1e-5F);
    EXPECT_EQ(output.load_torque_nm, 5.0F);
    drive.restart();
  }
}

TEST(DriveModel, RefusesWhatItCannotWorkWith) {
  using Error = DriveModel::ConfigError;
  EXPECT_EQ(DriveModel::make({.period_s = NAN, .inertia_kg_m2 = 0.1F}).error(), Error::kPeriod);
  EXPECT_EQ(DriveModel::make({.period_s = 0.0F, .inertia_kg_m2 = 0.1F}).error(), Error::kPeriod);
  EXPECT_EQ(DriveModel::make({.period_s = 0.05F, .inertia_kg_m2 = NAN}).error(), Error::kInertia);
  EXPECT_EQ(DriveModel::make({.period_s = 0.05F, .inertia_kg_m2 = -1.0F}).error(), Error::kInertia);
}

TEST(DriveModel, IsLinearAndContinuesBitExactlyWithoutAllocating) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> draw(-50.0F, 50.0F);
  auto original = DriveModel::make(kLathe).value();
  auto resumed = original;
  const auto allocations = allocation_count();
  for (int k = 0; k < 1000; ++k) {
    const DriveModel::Input input{.airgap_torque_nm = draw(random),
                                  .speed_rad_s = 100.0F + 0.1F * draw(random),
                                  .viscous_nm_s_rad = 0.01F};
    resumed.restore(original.state());
    const auto a = original.step(input);
    auto more = input;
    more.airgap_torque_nm += 1.0F;
    EXPECT_NEAR(resumed.step(more).external_torque_nm, a.external_torque_nm + 1.0F, 1e-4F);
    ASSERT_EQ(std::bit_cast<std::uint32_t>(original.state().speed_rad_s),
              std::bit_cast<std::uint32_t>(resumed.state().speed_rad_s));
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
