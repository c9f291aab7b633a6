#include "estimator/run_up_inertia.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <optional>
#include <random>

#include "support/allocation_count.hpp"
#include "support/same_bits.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::RunUpInertia;

constexpr RunUpInertia::Config kSpindle{.inertia_kg_m2 = 0.03F,
                                        .inertia_sigma_ratio = 0.15F,
                                        .coulomb_torque_nm = 0.4F,
                                        .viscous_nm_s_rad = 0.002F,
                                        .rated_torque_nm = 14.6F,
                                        .rated_speed_rad_s = 150.0F};
static_assert(kSpindle.check());

struct RunUp {
  double inertia = 0.03;
  double torque = 12.0;  // while speeding up
  double ramp_s = 0.4;
  double extra_friction = 0.2;  // beyond the configured, to be found by the tare
  double noise = 0.0;
  double sign = 1.0;
  double gap_s = -1.0;  // when the signals break off for a tick
};

// A run-up, 0.3 s of air, then the tare.
RunUpInertia after(const RunUp& run, const RunUpInertia::Config& config = kSpindle) {
  std::mt19937 random(41);
  std::normal_distribution<double> normal;
  auto block = RunUpInertia::make(config).value();
  double speed = 0.0;
  for (int k = 0; k < 700; ++k) {
    const double friction = 0.4 + run.extra_friction + 0.002 * std::abs(speed);
    const double torque = k * 1e-3 < run.ramp_s ? run.torque : friction;
    speed += 1e-3 * (torque - friction) / run.inertia;
    block.step({.torque_nm = static_cast<float>(run.sign * (torque + run.noise * normal(random))),
                .speed_rad_s = static_cast<float>(run.sign * speed),
                .duration_s = 1e-3F,
                .valid = std::abs(k * 1e-3 - run.gap_s) > 5e-4,
                .idle = false,
                .in_cut = false,
                .tare_nm = 0.0F,
                .calibrated = true});
  }
  block.step({.torque_nm = 0.0F,
              .speed_rad_s = static_cast<float>(run.sign * speed),
              .duration_s = 1e-3F,
              .valid = true,
              .idle = true,
              .in_cut = false,
              .tare_nm = static_cast<float>(run.sign * run.extra_friction),
              .calibrated = true});
  return block;
}

TEST(RunUpInertia, FindsTheInertiaWithinThreePercentFromTwentyPercentOff) {
  for (const double inertia : {0.025, 0.03, 0.0375}) {
    for (const double sign : {1.0, -1.0}) {
      const auto block = after({.inertia = inertia, .noise = 0.3, .sign = sign});
      EXPECT_NEAR(block.inertia_kg_m2(), inertia, 0.03 * inertia) << inertia << ' ' << sign;
      EXPECT_LT(block.sigma_ratio(), 0.03F);
      EXPECT_GT(block.sigma_ratio(), 0.001F);
    }
  }
}

TEST(RunUpInertia, IsExactWhereTheTorqueIs) {
  auto config = kSpindle;
  config.inertia_sigma_ratio = 10.0F;  // nothing is known beforehand
  EXPECT_NEAR(after({.inertia = 0.025}, config).inertia_kg_m2(), 0.025F, 1e-4F);
}

TEST(RunUpInertia, DoesNotBelieveWhatIsFarFromTheValueGiven) {
  const auto block = after({.inertia = 0.045});
  EXPECT_EQ(block.inertia_kg_m2(), 0.03F);
  EXPECT_EQ(block.sigma_ratio(), 0.15F);
}

TEST(RunUpInertia, LearnsNothingFromARunUpThatIsTooSlow) {
  const auto block = after({.inertia = 0.033, .torque = 0.15, .ramp_s = 0.3});
  EXPECT_EQ(block.inertia_kg_m2(), 0.03F);
}

TEST(RunUpInertia, BeginsAnewAfterAGap) {
  EXPECT_NEAR(after({.inertia = 0.026, .gap_s = 0.1}).inertia_kg_m2(), 0.026, 0.03 * 0.026);
}

// One ramp between two idles after another; the second also holds a cut.
TEST(RunUpInertia, LearnsFromEveryChangeOfSpeedButNotFromOneWithACut) {
  constexpr float kInertia = 0.033F;
  for (const bool with_cut : {false, true}) {
    auto block = RunUpInertia::make(kSpindle).value();
    float speed = 100.0F;
    const auto tick = [&](float acceleration, bool idle, bool in_cut) {
      speed += acceleration * 1e-3F;
      const float friction = kSpindle.coulomb_torque_nm + kSpindle.viscous_nm_s_rad * speed;
      block.step({.torque_nm = friction + kInertia * acceleration + (in_cut ? 5.0F : 0.0F),
                  .speed_rad_s = speed,
                  .duration_s = 1e-3F,
                  .valid = true,
                  .idle = idle,
                  .in_cut = in_cut,
                  .tare_nm = 0.0F,
                  .calibrated = true});
    };
    for (int k = 0; k < 100; ++k) tick(0.0F, true, false);
    EXPECT_EQ(block.inertia_kg_m2(), kSpindle.inertia_kg_m2);
    for (int k = 0; k < 250; ++k) tick(200.0F, false, with_cut && k > 100 && k < 150);
    for (int k = 0; k < 100; ++k) tick(0.0F, false, with_cut);
    for (int k = 0; k < 100; ++k) tick(0.0F, true, false);
    if (with_cut) {
      EXPECT_EQ(block.inertia_kg_m2(), kSpindle.inertia_kg_m2);
    } else {
      EXPECT_NEAR(block.inertia_kg_m2(), kInertia, 0.01F * kInertia);
    }
  }
}

TEST(RunUpInertia, RefusesWhatItCannotWorkWith) {
  using Error = RunUpInertia::ConfigError;
  const auto refused = [](auto change) {
    auto config = kSpindle;
    change(config);
    const auto made = RunUpInertia::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.inertia_kg_m2 = 0.0F; }), Error::kInertia);
  EXPECT_EQ(refused([](auto& c) { c.inertia_sigma_ratio = NAN; }), Error::kInertia);
  EXPECT_EQ(refused([](auto& c) { c.rated_torque_nm = -1.0F; }), Error::kInertia);
  EXPECT_EQ(refused([](auto& c) { c.rated_speed_rad_s = 0.0F; }), Error::kInertia);
  EXPECT_EQ(refused([](auto& c) { c.coulomb_torque_nm = -1.0F; }), Error::kFriction);
  EXPECT_EQ(refused([](auto& c) { c.viscous_nm_s_rad = NAN; }), Error::kFriction);
  EXPECT_EQ(refused([](auto&) {}), std::nullopt);
}

TEST(RunUpInertia, StaysWithinTwoPriorSigmasWhateverItIsGiven) {
  std::mt19937 random(42);
  std::uniform_real_distribution<float> draw(-1.0F, 1.0F);
  for (int run = 0; run < 2000; ++run) {
    auto block = RunUpInertia::make(kSpindle).value();
    for (int k = 0; k < 100; ++k) {
      block.step({.torque_nm = 30.0F * draw(random),
                  .speed_rad_s = 300.0F * draw(random),
                  .duration_s = 1e-3F,
                  .valid = draw(random) < 0.95F,
                  .idle = k == 99,
                  .in_cut = false,
                  .tare_nm = draw(random),
                  .calibrated = true});
    }
    ASSERT_TRUE(block.inertia_kg_m2() > 0.0209F && block.inertia_kg_m2() < 0.0391F) << run;
    ASSERT_TRUE(block.sigma_ratio() > 0.0F && block.sigma_ratio() <= 0.15F) << run;
  }
}

TEST(RunUpInertia, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  auto original = RunUpInertia::make(kSpindle).value();
  auto resumed = original;
  const auto allocations = allocation_count();
  for (int k = 0; k < 600; ++k) {
    resumed.restore(original.state());
    const RunUpInertia::Input input{.torque_nm = 10.0F,
                                    .speed_rad_s = 0.3F * static_cast<float>(k),
                                    .duration_s = 1e-3F,
                                    .valid = k != 50,
                                    .idle = k == 599,
                                    .in_cut = false,
                                    .tare_nm = 0.1F,
                                    .calibrated = true};
    original.step(input);
    resumed.step(input);
    ASSERT_TRUE(same_bits(original.state(), resumed.state())) << k;
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
