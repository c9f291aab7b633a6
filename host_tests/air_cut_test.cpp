#include "estimator/air_cut.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <optional>
#include <random>

#include "support/allocation_count.hpp"
#include "support/same_bits.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::AirCut;
using Phase = AirCut::Phase;
using Feed = AirCut::Feed;

constexpr double kRated = 14.6;
constexpr double kTick = 1e-3;

constexpr AirCut::Config kSpindle{.rated_torque_nm = 14.6F,
                                  .inertia_kg_m2 = 0.03F,
                                  .coulomb_torque_nm = 0.4F,
                                  .viscous_nm_s_rad = 0.002F,
                                  .contact_ratio = 0.015F,
                                  .friction_limit_ratio = 0.15F};
static_assert(kSpindle.check());

// A spindle whose friction differs from the nominal, and an estimate of its load torque that is
// right but for noise and an inertia that may be wrong.
class Spindle {
 public:
  double speed = 150.0;
  double sense = 1.0;  // -1: turns backward, everything mirrored
  double extra_friction = 0.02 * kRated;
  double cut = 0.0;
  double noise = 0.003 * kRated;
  double inertia_error = 0.0;  // of 0.03
  Feed feed = Feed::kUnknown;
  bool calibrated = true;

  AirCut block = AirCut::make(kSpindle).value();
  AirCut::Output output{};
  bool ever_cut = false;
  bool ever_idle = false;

  // Runs for some time at an acceleration.
  void run(double seconds, double acceleration = 0.0) {
    ever_cut = ever_idle = false;
    const int ticks = static_cast<int>(std::lround(seconds / kTick));
    for (int k = 0; k < ticks; ++k) {
      speed += acceleration * kTick;
      // No estimate of the load is faster than this, nor is a drive's torque.
      lagged_acceleration_ += 0.1 * (acceleration - lagged_acceleration_);
      output = block.step(input(acceleration));
      ever_cut = ever_cut || output.phase == Phase::kCut;
      ever_idle = ever_idle || output.phase == Phase::kIdle;
    }
  }
  // Runs until the phase comes; how long that took, or 1e9.
  double until(Phase phase, double most_s) {
    for (double t = 0.0; t < most_s; t += kTick) {
      run(kTick);
      if (output.phase == phase) return t;
    }
    return 1e9;
  }

  AirCut::Input input(double acceleration) {
    std::normal_distribution<double> normal;
    const double load = 0.4 + 0.002 * speed + extra_friction + cut;
    const double wrong = inertia_error * 0.03 * lagged_acceleration_;
    const double seen = load + wrong + noise * normal(random_);
    return {.load_torque_nm = static_cast<float>(sense * seen),
            .sigma_nm = static_cast<float>(noise),
            .model_sigma_nm = 0.0F,
            .airgap_torque_nm = static_cast<float>(sense * (load + 0.03 * acceleration)),
            .speed_rad_s = static_cast<float>(sense * speed),
            .speed_sigma_rad_s = 0.01F,
            .duration_s = static_cast<float>(kTick),
            .feed = feed,
            .calibrated = calibrated,
            .valid = true};
  }

  [[nodiscard]] double tare_error() const {
    return static_cast<double>(output.tare_nm) - extra_friction;
  }
  [[nodiscard]] double net() const { return sense * static_cast<double>(output.net_torque_nm); }

 private:
  double lagged_acceleration_ = 0.0;
  std::mt19937 random_{81};
};

Spindle after_run_up(double sense = 1.0) {
  Spindle spindle;
  spindle.sense = sense;
  spindle.speed = 5.0;
  spindle.run(0.5, 290.0);
  EXPECT_FALSE(spindle.ever_cut);
  EXPECT_FALSE(spindle.ever_idle);
  spindle.run(1.0);
  return spindle;
}

TEST(AirCut, TaresInTheAirAfterTheRunUpInBothDirections) {
  for (const double sense : {1.0, -1.0}) {
    auto spindle = after_run_up(sense);
    EXPECT_EQ(spindle.output.phase, Phase::kIdle);
    EXPECT_TRUE(spindle.output.has_tare);
    EXPECT_NEAR(spindle.tare_error(), 0.0, 0.001 * kRated) << sense;
    EXPECT_LT(std::sqrt(spindle.output.tare_variance_nm2), 0.002 * kRated);
    EXPECT_FALSE(spindle.ever_cut);
    spindle.run(20.0);
    EXPECT_FALSE(spindle.ever_cut);
    EXPECT_NEAR(spindle.tare_error(), 0.0, 0.001 * kRated) << sense;
  }
}

TEST(AirCut, NoticesContactAtOnceAndHoldsTheTareThroughTheCut) {
  for (const double sense : {1.0, -1.0}) {
    auto spindle = after_run_up(sense);
    spindle.cut = 0.1 * kRated;
    EXPECT_LE(spindle.until(Phase::kCut, 0.1), 2e-3) << sense;
    spindle.run(10.0);
    EXPECT_FALSE(spindle.ever_idle);
    EXPECT_NEAR(spindle.tare_error(), 0.0, 0.0015 * kRated) << sense;
    EXPECT_NEAR(spindle.net(), 0.1 * kRated, 0.02 * kRated) << sense;
    EXPECT_NEAR(spindle.output.tare_age_s, 10.0F, 0.05F);
  }
}

// The beginning of a slow entry lies below the threshold; the tare must not swallow it. Below 0.1
// rated torques a second an entry cannot be told from friction that drifts; EQUATIONS (E92).
TEST(AirCut, DoesNotTakeASlowEntryForFriction) {
  for (const double rated_per_s : {0.1, 0.3, 1.0, 10.0}) {
    auto spindle = after_run_up();
    bool contact = false;
    for (int k = 0; k < 2000 && spindle.cut < 0.3 * kRated; ++k) {
      spindle.cut += rated_per_s * kRated * kTick;
      spindle.run(kTick);
      contact = contact || spindle.output.phase == Phase::kCut;
    }
    EXPECT_TRUE(contact) << rated_per_s;
    EXPECT_NEAR(spindle.tare_error(), 0.0, 0.0065 * kRated) << rated_per_s;
  }
}

TEST(AirCut, FindsTheAirAgainAfterACutAndTheNextContact) {
  auto spindle = after_run_up();
  for (int pass = 0; pass < 4; ++pass) {
    spindle.cut = 0.4 * kRated;
    EXPECT_LE(spindle.until(Phase::kCut, 0.1), 2e-3) << pass;
    spindle.run(1.0);
    spindle.cut = 0.0;
    EXPECT_LT(spindle.until(Phase::kIdle, 1.0), 0.6) << pass;
    spindle.run(0.4);
    EXPECT_EQ(spindle.output.phase, Phase::kIdle) << pass;
    EXPECT_NEAR(spindle.tare_error(), 0.0, 0.002 * kRated) << pass;
  }
}

// With an inertia wrong by 10 % a change of speed looks like 4 % of load.
TEST(AirCut, DoesNotTakeAChangeOfSpeedInTheAirForACut) {
  for (const double error : {-0.1, 0.1}) {
    for (const double acceleration : {200.0, -200.0}) {
      auto spindle = after_run_up();
      spindle.inertia_error = error;
      spindle.run(0.3, acceleration);
      EXPECT_FALSE(spindle.ever_cut) << error << ' ' << acceleration;
      spindle.run(1.0);
      EXPECT_EQ(spindle.output.phase, Phase::kIdle) << error << ' ' << acceleration;
      EXPECT_NEAR(spindle.tare_error(), 0.0, 0.002 * kRated) << error << ' ' << acceleration;
    }
  }
}

TEST(AirCut, KeepsTheCutThroughAChangeOfSpeed) {
  for (const double acceleration : {100.0, -100.0}) {
    auto spindle = after_run_up();
    spindle.cut = 0.4 * kRated;
    spindle.run(1.0);
    spindle.inertia_error = 0.1;
    spindle.run(0.5, acceleration);
    spindle.run(1.0);
    EXPECT_FALSE(spindle.ever_idle);
    EXPECT_EQ(spindle.output.phase, Phase::kCut);
    EXPECT_NEAR(spindle.tare_error(), 0.0, 0.0015 * kRated) << acceleration;
  }
}

TEST(AirCut, NeverTaresWhatItFindsItselfInACutWith) {
  Spindle spindle;
  spindle.cut = 0.5 * kRated;
  spindle.run(3.0);
  EXPECT_EQ(spindle.output.phase, Phase::kCut);
  EXPECT_FALSE(spindle.output.has_tare);
  EXPECT_EQ(spindle.output.tare_nm, 0.0F);
  EXPECT_GT(std::sqrt(spindle.output.tare_variance_nm2), 0.005 * kRated);  // friction is unknown
  spindle.cut = 0.0;
  EXPECT_LT(spindle.until(Phase::kIdle, 3.0), 2.0);
  spindle.run(1.0);
  EXPECT_NEAR(spindle.tare_error(), 0.0, 0.001 * kRated);
}

TEST(AirCut, BelievesTheFeedSignalMoreThanTheTorque) {
  auto spindle = after_run_up();
  spindle.feed = Feed::kIdle;
  spindle.run(0.5);
  spindle.extra_friction = 0.06 * kRated;  // warmed up, or a belt: no contact, for nothing feeds
  spindle.run(20.0);
  EXPECT_FALSE(spindle.ever_cut);
  EXPECT_NEAR(spindle.tare_error(), 0.0, 0.003 * kRated);
  spindle.feed = Feed::kActive;
  spindle.run(kTick);
  EXPECT_EQ(spindle.output.phase, Phase::kCut);
}

TEST(AirCut, FollowsFrictionThatDriftsSlowly) {
  auto spindle = after_run_up();
  for (int k = 0; k < 30'000; ++k) {
    spindle.extra_friction += 0.001 * kRated * kTick;
    spindle.run(kTick);
    ASSERT_NE(spindle.output.phase, Phase::kCut) << k;
  }
  EXPECT_NEAR(spindle.tare_error(), 0.0, 0.003 * kRated);
}

TEST(AirCut, DoesNotTareBeforeTheChannelsAreCalibrated) {
  Spindle spindle;
  spindle.calibrated = false;
  spindle.run(2.0);
  EXPECT_EQ(spindle.output.phase, Phase::kUnsteady);
  EXPECT_FALSE(spindle.output.has_tare);
  EXPECT_TRUE(spindle.output.steady);
  spindle.calibrated = true;
  EXPECT_LT(spindle.until(Phase::kIdle, 1.0), 0.3);
}

TEST(AirCut, AgesItsTareOutsideTheAir) {
  auto spindle = after_run_up();
  const float fresh = std::sqrt(spindle.output.tare_variance_nm2);
  spindle.cut = 0.4 * kRated;
  spindle.run(20.0);
  EXPECT_GT(std::sqrt(spindle.output.tare_variance_nm2), fresh + 5e-4F * 14.6F);
}

TEST(AirCut, StaysUnsteadyWhileNoTorqueCanBeTold) {
  auto spindle = after_run_up();
  auto input = spindle.input(0.0);
  input.valid = false;
  const auto output = spindle.block.step(input);
  EXPECT_EQ(output.phase, Phase::kUnsteady);
  EXPECT_FALSE(output.steady);
  EXPECT_EQ(output.idle_s, 0.0F);
  EXPECT_TRUE(output.has_tare);  // friction is still the best that is known
}

TEST(AirCut, RefusesWhatItCannotWorkWith) {
  using Error = AirCut::ConfigError;
  const auto refused = [](auto change) {
    auto config = kSpindle;
    change(config);
    const auto made = AirCut::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.rated_torque_nm = 0.0F; }), Error::kTorque);
  EXPECT_EQ(refused([](auto& c) { c.inertia_kg_m2 = NAN; }), Error::kInertia);
  EXPECT_EQ(refused([](auto& c) { c.coulomb_torque_nm = -0.1F; }), Error::kFriction);
  EXPECT_EQ(refused([](auto& c) { c.viscous_nm_s_rad = NAN; }), Error::kFriction);
  EXPECT_EQ(refused([](auto& c) { c.contact_ratio = 0.0F; }), Error::kTorque);
  EXPECT_EQ(refused([](auto& c) { c.friction_limit_ratio = 0.01F; }), Error::kTorque);
  EXPECT_EQ(refused([](auto&) {}), std::nullopt);
}

TEST(AirCut, StaysFiniteUnderRandomInput) {
  std::mt19937 random(82);
  std::uniform_real_distribution<float> draw(-1.0F, 1.0F);
  auto block = AirCut::make(kSpindle).value();
  for (int k = 0; k < 300'000; ++k) {
    const auto output = block.step({.load_torque_nm = 30.0F * draw(random),
                                    .sigma_nm = std::abs(draw(random)),
                                    .model_sigma_nm = std::abs(draw(random)),
                                    .airgap_torque_nm = 30.0F * draw(random),
                                    .speed_rad_s = 200.0F * draw(random),
                                    .speed_sigma_rad_s = std::abs(draw(random)),
                                    .duration_s = 1e-3F * (1.1F + draw(random)),
                                    .feed = static_cast<Feed>(k / 1000 % 3),
                                    .calibrated = k % 5000 > 100,
                                    .valid = k % 3001 > 5});
    ASSERT_LT(std::abs(output.net_torque_nm), 200.0F) << k;
    ASSERT_LT(std::abs(output.tare_nm), 100.0F) << k;
    ASSERT_TRUE(output.tare_variance_nm2 >= 0.0F && output.tare_variance_nm2 < 1e4F) << k;
    ASSERT_TRUE(output.idle_variance_nm2 >= 0.0F && output.idle_variance_nm2 < 1e5F) << k;
  }
}

TEST(AirCut, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  auto spindle = after_run_up();
  auto original = AirCut::make(kSpindle).value();
  auto resumed = original;
  const auto allocations = allocation_count();
  for (int k = 0; k < 3000; ++k) {
    resumed.restore(original.state());
    spindle.cut = k > 1000 && k < 2000 ? 0.3 * kRated : 0.0;
    const auto input = spindle.input(0.0);
    const auto a = original.step(input);
    const auto b = resumed.step(input);
    ASSERT_EQ(a.phase, b.phase) << k;
    ASSERT_EQ(a.net_torque_nm, b.net_torque_nm) << k;
    ASSERT_TRUE(same_bits(original.state(), resumed.state())) << k;
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
