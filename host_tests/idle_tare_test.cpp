#include "estimator/idle_tare.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <functional>
#include <optional>
#include <random>

#include "support/allocation_count.hpp"
#include "support/torque_path_config.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::Feed;
using estimator::IdleTare;

constexpr float kRatedNm = 14.6F;
constexpr IdleTare::Config kConfig = small_motor_tare();
static_assert(kConfig.check());

// A spindle whose friction differs from the machine file, and a cut on top of it.
struct Bench {
  IdleTare tare = IdleTare::make(kConfig).value();
  float coulomb_nm = 0.55F;  // file: 0.4
  float viscous_nm_s_rad = 0.002F;
  float speed_rad_s = 157.0F;
  float noise_nm = 0.01F;
  Feed feed = Feed::kUnknown;
  std::mt19937 random{10};
  std::normal_distribution<float> normal;
  IdleTare::Output output{};

  float idle_nm() const { return coulomb_nm + viscous_nm_s_rad * speed_rad_s; }

  // `cut_nm` over the time since the call.
  void run(float duration_s, const std::function<float(float)>& cut_nm) {
    const int windows = static_cast<int>(duration_s / 0.05F + 0.5F);
    for (int k = 0; k < windows; ++k) {
      const float torque =
          idle_nm() + cut_nm(0.05F * static_cast<float>(k + 1)) + noise_nm * normal(random);
      output = tare.step({.load_torque_nm = torque,
                          .inertia_torque_nm = 0.0F,
                          .speed_rad_s = speed_rad_s,
                          .feed = feed,
                          .valid = true});
    }
  }
  void idle(float duration_s) {
    run(duration_s, [](float) { return 0.0F; });
  }
  float error_nm() const { return output.idle_torque_nm - idle_nm(); }
};

TEST(IdleTare, FindsTheIdleTorqueAndKeepsItThroughACut) {
  Bench bench;
  bench.idle(2.0F);
  EXPECT_TRUE(bench.output.acquired);
  EXPECT_FALSE(bench.output.in_cut);
  EXPECT_NEAR(bench.error_nm(), 0.0F, 0.01F);
  // One speed only: the split stays as the machine file has it, the offset moves.
  EXPECT_EQ(bench.output.viscous_nm_s_rad, kConfig.viscous_nm_s_rad);
  EXPECT_NEAR(bench.output.coulomb_nm, 0.55F, 0.01F);

  const float tared = bench.output.idle_torque_nm;
  bench.run(10.0F, [](float) { return 6.0F; });
  EXPECT_TRUE(bench.output.in_cut);
  EXPECT_EQ(bench.output.idle_torque_nm, tared);
  EXPECT_NEAR(bench.output.age_s, 10.0F, 0.11F);
  bench.idle(2.0F);
  EXPECT_FALSE(bench.output.in_cut);
  EXPECT_LT(bench.output.age_s, 0.06F);
}

TEST(IdleTare, ReportsContactInTheWindowOfTheContact) {
  Bench bench;
  bench.idle(2.0F);
  bench.run(0.05F, [](float) { return 1.0F; });
  EXPECT_TRUE(bench.output.in_cut);
}

TEST(IdleTare, DoesNotTareWhenStartedInsideACut) {
  Bench bench;
  bench.run(20.0F, [](float) { return 0.3F * kRatedNm; });
  EXPECT_TRUE(bench.output.in_cut);
  EXPECT_FALSE(bench.output.acquired);
  EXPECT_NEAR(bench.output.coulomb_nm, kConfig.coulomb_nm, 1e-6F);
  EXPECT_EQ(bench.output.sigma_nm, kConfig.idle_sigma_nm);
  bench.idle(2.0F);
  EXPECT_TRUE(bench.output.acquired);
  EXPECT_NEAR(bench.error_nm(), 0.0F, 0.015F);
}

// A cut so small that it passes for friction unknown: found out when the torque falls below it.
TEST(IdleTare, TaresAnewWhenTheTorqueRestsBelowTheTare) {
  Bench bench;
  bench.run(5.0F, [](float) { return 0.04F * kRatedNm; });
  EXPECT_TRUE(bench.output.acquired);
  bench.idle(2.0F);
  EXPECT_NEAR(bench.error_nm(), 0.0F, 0.015F);
}

TEST(IdleTare, DoesNotFollowARampOfAnySlope) {
  for (const float slope : {0.005F, 0.01F, 0.05F, 0.3F, 2.0F}) {  // of rated torque a second
    Bench bench;
    bench.idle(3.0F);
    const float end_s = 0.2F / slope;
    bench.run(end_s, [&](float t) { return slope * t * kRatedNm; });
    EXPECT_TRUE(bench.output.in_cut) << slope;
    EXPECT_NEAR(bench.error_nm() / kRatedNm, 0.0F, 0.003F) << slope;
    bench.run(60.0F, [&](float) { return 0.2F * kRatedNm; });
    EXPECT_NEAR(bench.error_nm() / kRatedNm, 0.0F, 0.003F) << slope;
  }
}

TEST(IdleTare, DoesNotTareInAStepOfHalfAPercent) {
  for (const float step : {0.005F, 0.01F, 0.02F}) {
    Bench bench;
    bench.noise_nm = 0.005F;
    bench.idle(3.0F);
    bench.run(60.0F, [&](float) { return step * kRatedNm; });
    EXPECT_TRUE(bench.output.in_cut) << step;
    EXPECT_NEAR(bench.error_nm() / kRatedNm, 0.0F, 0.001F) << step;
  }
}

// Below what can be told from idle the tare creeps, no faster than it is allowed to.
TEST(IdleTare, BoundsItsDrift) {
  Bench bench;
  bench.idle(3.0F);
  bench.run(5.0F, [](float t) { return std::min(0.001F * t, 0.02F); });
  EXPECT_LE(bench.error_nm(), 5.0F * kConfig.drift_nm_s);
}

TEST(IdleTare, IgnoresGapsOfAWindowBetweenCuts) {
  Bench bench;
  bench.idle(2.0F);
  const float tared = bench.output.idle_torque_nm;
  for (int k = 0; k < 50; ++k) {
    bench.run(0.5F, [](float) { return 5.0F; });
    bench.run(0.05F * static_cast<float>(1 + k % 3), [](float) { return 0.0F; });
  }
  EXPECT_EQ(bench.output.idle_torque_nm, tared);
}

TEST(IdleTare, TellsViscousFromCoulombOnceItHasIdledAtTwoSpeeds) {
  Bench bench;
  bench.viscous_nm_s_rad = 0.004F;  // file: 0.002
  bench.noise_nm = 0.003F;
  for (const float speed : {157.0F, 60.0F, 157.0F, 110.0F}) {
    bench.speed_rad_s = speed;
    bench.idle(2.0F);
    bench.run(2.0F, [](float) { return 5.0F; });
    EXPECT_NEAR(bench.error_nm(), 0.0F, 0.01F) << speed;
  }
  EXPECT_NEAR(bench.output.viscous_nm_s_rad, 0.004F, 1e-4F);
  EXPECT_NEAR(bench.output.coulomb_nm, 0.55F, 0.015F);
  // Now an unseen speed inside a cut is right without an idle there.
  bench.speed_rad_s = 80.0F;
  bench.run(1.0F, [](float) { return 5.0F; });
  EXPECT_NEAR(bench.error_nm(), 0.0F, 0.02F);
}

// Friction at a speed never idled at, and an inertia that is 5 % off while the speed gets there:
// neither is a cut.
TEST(IdleTare, DoesNotTakeAChangeOfSpeedForACut) {
  Bench bench;
  bench.viscous_nm_s_rad = 0.004F;  // file: 0.002
  bench.speed_rad_s = 60.0F;
  bench.idle(2.0F);
  for (int k = 0; k < 10; ++k) {
    bench.speed_rad_s += 9.7F;
    const float inertia_nm = 0.03F * 9.7F / 0.05F;
    bench.output = bench.tare.step({.load_torque_nm = bench.idle_nm() + 0.05F * inertia_nm,
                                    .inertia_torque_nm = inertia_nm,
                                    .speed_rad_s = bench.speed_rad_s,
                                    .feed = Feed::kUnknown,
                                    .valid = true});
    EXPECT_FALSE(bench.output.in_cut) << k;
  }
  bench.idle(1.0F);
  EXPECT_FALSE(bench.output.in_cut);
  EXPECT_NEAR(bench.error_nm(), 0.0F, 0.015F);
}

TEST(IdleTare, TakesTheWordOfTheCnc) {
  Bench bench;
  bench.coulomb_nm = 3.0F;  // far from the machine file: alone it would call this a cut
  bench.feed = Feed::kAir;
  bench.idle(2.0F);
  EXPECT_NEAR(bench.error_nm(), 0.0F, 0.01F);
  bench.feed = Feed::kCut;
  bench.run(20.0F, [](float) { return 0.02F; });  // far below any band
  EXPECT_TRUE(bench.output.in_cut);
  EXPECT_NEAR(bench.error_nm(), 0.0F, 0.01F);
}

// Two sigma of the tare against its error, over many machines; the age widens it in the cut.
TEST(IdleTare, StatesHowFarOffItMayBe) {
  int covered = 0;
  constexpr int kMachines = 200;
  for (int k = 0; k < kMachines; ++k) {
    Bench bench;
    bench.random.seed(static_cast<unsigned>(k));
    bench.noise_nm = 0.03F;
    bench.idle(3.0F);
    covered += std::abs(bench.error_nm()) <= 2.0F * bench.output.sigma_nm ? 1 : 0;
    const float young = bench.output.sigma_nm;
    bench.run(5.0F, [](float) { return 5.0F; });
    EXPECT_GT(bench.output.sigma_nm, young);
  }
  EXPECT_GE(covered, kMachines * 9 / 10);
}

TEST(IdleTare, WaitsThroughStandstillAndMissingTorque) {
  Bench bench;
  bench.idle(2.0F);
  const float tared = bench.output.coulomb_nm;
  bench.speed_rad_s = 0.0F;
  bench.idle(2.0F);
  EXPECT_FALSE(bench.output.taring);
  EXPECT_EQ(bench.output.coulomb_nm, tared);
  const auto output = bench.tare.step({.load_torque_nm = NAN,
                                       .inertia_torque_nm = NAN,
                                       .speed_rad_s = 157.0F,
                                       .feed = Feed::kUnknown,
                                       .valid = false});
  EXPECT_EQ(output.coulomb_nm, tared);
  bench.speed_rad_s = 157.0F;
  bench.idle(1.0F);
  EXPECT_TRUE(bench.output.taring);
}

TEST(IdleTare, RefusesWhatItCannotWorkWith) {
  using Error = IdleTare::ConfigError;
  const auto refused = [](auto change) {
    auto config = kConfig;
    change(config);
    const auto made = IdleTare::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.period_s = NAN; }), Error::kPeriod);
  EXPECT_EQ(refused([](auto& c) { c.coulomb_nm = -0.1F; }), Error::kFriction);
  EXPECT_EQ(refused([](auto& c) { c.idle_sigma_nm = 0.0F; }), Error::kFrictionSigma);
  EXPECT_EQ(refused([](auto& c) { c.viscous_sigma_nm_s_rad = NAN; }), Error::kFrictionSigma);
  EXPECT_EQ(refused([](auto& c) { c.band_least_nm = 1.0F; }), Error::kBand);
  EXPECT_EQ(refused([](auto& c) { c.inertia_sigma_ratio = -1.0F; }), Error::kInertiaSigma);
  EXPECT_EQ(refused([](auto& c) { c.wait_s = 0.1F; }), Error::kTimes);
  EXPECT_EQ(refused([](auto& c) { c.drift_nm_s = 0.0F; }), Error::kDrift);
  EXPECT_EQ(refused([](auto& c) { c.forgetting_ratio = 0.0F; }), Error::kSpeeds);
  EXPECT_EQ(refused([](auto& c) { c.minimum_speed_rad_s = NAN; }), Error::kSpeeds);
}

TEST(IdleTare, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> draw(0.0F, 1.0F);
  auto original = IdleTare::make(kConfig).value();
  auto resumed = IdleTare::make(kConfig).value();
  const auto allocations = allocation_count();
  for (int k = 0; k < 5000; ++k) {
    const float cut = k / 40 % 3 == 2 ? 4.0F : 0.0F;
    const IdleTare::Input input{.load_torque_nm = 0.7F + cut + 0.01F * draw(random),
                                .inertia_torque_nm = 0.0F,
                                .speed_rad_s = k / 300 % 2 == 0 ? 157.0F : 80.0F,
                                .feed = Feed::kUnknown,
                                .valid = true};
    resumed.restore(original.state());
    const auto a = original.step(input);
    const auto b = resumed.step(input);
    ASSERT_EQ(std::bit_cast<std::uint32_t>(a.idle_torque_nm),
              std::bit_cast<std::uint32_t>(b.idle_torque_nm));
    ASSERT_EQ(a.in_cut, b.in_cut);
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
