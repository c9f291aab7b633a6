#include "estimator/torque_path.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <random>
#include <vector>

#include "support/allocation_count.hpp"
#include "support/torque_path_config.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::Feed;
using estimator::TorquePath;

// A spindle at a held speed whose power is stated instead of simulated: v and i in phase, no slip
// between the power's speed and the shaft. Frequency by the current's rotation at two pole pairs.
struct Rig {
  TorquePath::Config config;
  float speed_rad_s = 157.0F;
  float airgap_nm = 0.714F;  // idle torque of the machine file at this speed
  float meter_w = 112.1F;
  double angle_rad = 0.0;

  TorquePath::Input sample(bool backwards = false) {
    const double period_s = static_cast<double>(config.power.sample_period_s);
    angle_rad += (backwards ? -2.0 : 2.0) * static_cast<double>(speed_rad_s) * period_s;
    const auto c = static_cast<float>(std::cos(angle_rad));
    const auto s = static_cast<float>(std::sin(angle_rad));
    constexpr float kCurrentA = 5.0F;
    const float volt = airgap_nm * speed_rad_s / (1.5F * kCurrentA) + 3.7F * kCurrentA;
    return {
        .motor = {.voltage_v = {volt * c, volt * s}, .current_a = {kCurrentA * c, kCurrentA * s}},
        .speed_rad_s = backwards ? -speed_rad_s : speed_rad_s,
        .power_meter_w = meter_w,
        .motor_valid = true,
        .speed_valid = true,
        .meter_valid = true,
        .feed = Feed::kUnknown};
  }
};

constexpr float kIdleNm = 0.714F;

TorquePath::Output run(TorquePath& path, Rig& rig, float duration_s, bool backwards = false) {
  TorquePath::Output last{};
  const auto samples = static_cast<int>(duration_s / rig.config.power.sample_period_s + 0.5F);
  for (int k = 0; k < samples; ++k) {
    if (const auto output = path.step(rig.sample(backwards))) last = *output;
  }
  return last;
}

// 10 N m of cutting and 5 % of friction on top.
TEST(TorquePath, FindsTheCuttingTorqueByEveryMethodInBothDirections) {
  for (const auto method : {TorquePath::Method::kMeasured, TorquePath::Method::kComputed,
                            TorquePath::Method::kSynthesized}) {
    for (const bool backwards : {false, true}) {
      Rig rig{.config = small_motor_path(method, 1000.0F)};
      auto path = TorquePath::make(rig.config).value();
      (void)run(path, rig, 3.0F, backwards);
      rig.airgap_nm = kIdleNm + 10.5F;
      rig.meter_w = rig.airgap_nm * rig.speed_rad_s;
      const auto output = run(path, rig, 1.0F, backwards);
      const float sign = backwards ? -1.0F : 1.0F;
      EXPECT_TRUE(output.torque_valid && output.in_cut && output.tared);
      EXPECT_NEAR(output.cutting_torque_nm, sign * 10.0F, 0.01F);
      EXPECT_NEAR(output.load_torque_nm, sign * (kIdleNm + 10.5F), 0.01F);
      EXPECT_NEAR(output.airgap_torque_nm, output.load_torque_nm, 1e-4F);
      EXPECT_NEAR(output.airgap_power_w, rig.meter_w, 1.0F);
      EXPECT_GT(output.cutting_torque_sigma_nm, 0.0F);
    }
  }
}

// EQUATIONS.md of the papers, list 3: the meter of 0.1 s dead time and 0.1 s lag reaches 90 % of a
// step after 0.3 s, the synthesized monitor within 0.1 s.
TEST(TorquePath, LagsAStepAsThePaperSays) {
  for (const auto method : {TorquePath::Method::kMeasured, TorquePath::Method::kSynthesized}) {
    Rig rig{.config = small_motor_path(method, 1000.0F)};
    rig.config.meter.lag_s = 0.1F;
    auto path = TorquePath::make(rig.config).value();
    std::vector<float> power(100, rig.meter_w);  // dead time
    float meter_w = rig.meter_w;
    float before_nm = 0.0F;
    float reached_s = 0.0F;
    for (int k = 0; k < 5000 && reached_s == 0.0F; ++k) {
      rig.airgap_nm = k < 3000 ? kIdleNm : kIdleNm + 10.5F;
      const auto slot = static_cast<std::size_t>(k % 100);
      meter_w += (power[slot] - meter_w) * 0.001F / 0.1F;
      power[slot] = rig.airgap_nm * rig.speed_rad_s;
      rig.meter_w = meter_w;
      const auto output = path.step(rig.sample());
      if (!output) continue;
      const float now_nm = output->cutting_torque_nm;
      // On the straight line between two windows.
      if (k > 3000 && now_nm >= 9.0F) {
        reached_s = 0.001F * static_cast<float>(k + 1 - 3000) -
                    0.05F * (now_nm - 9.0F) / (now_nm - before_nm);
      }
      before_nm = now_nm;
    }
    if (method == TorquePath::Method::kMeasured) {
      // 0.33 s are the meter's own; the mean over a window puts half a window on top, which is no
      // part of the paper's statement.
      EXPECT_NEAR(reached_s - 0.025F, 0.3F, 0.05F);
    } else {
      EXPECT_LE(reached_s, 0.1F);
      EXPECT_GT(reached_s, 0.0F);
    }
  }
}

TEST(TorquePath, SaysNothingAboutTorqueBelowTheMinimumSpeed) {
  Rig rig{.config = small_motor_path(TorquePath::Method::kSynthesized, 1000.0F)};
  auto path = TorquePath::make(rig.config).value();
  rig.speed_rad_s = 4.0F;
  const auto output = run(path, rig, 1.0F);
  EXPECT_FALSE(output.torque_valid);
  EXPECT_EQ(output.origin, TorquePath::Origin::kNone);
  EXPECT_EQ(output.cutting_torque_nm, 0.0F);
  EXPECT_TRUE(output.airgap_power_valid);
  rig.speed_rad_s = 0.0F;
  EXPECT_FALSE(run(path, rig, 1.0F).torque_valid);
}

TEST(TorquePath, WorksWithWhatThereIs) {
  Rig rig{.config = small_motor_path(TorquePath::Method::kSynthesized, 1000.0F)};
  const auto with = [&](bool motor, bool meter, bool speed) {
    auto path = TorquePath::make(rig.config).value();
    TorquePath::Output last{};
    for (int k = 0; k < 4000; ++k) {
      rig.airgap_nm = k < 3000 ? kIdleNm : kIdleNm + 10.5F;
      rig.meter_w = rig.airgap_nm * rig.speed_rad_s;
      auto input = rig.sample();
      input.motor_valid = motor;
      input.meter_valid = meter;
      input.speed_valid = speed;
      if (!motor) input.motor = {.voltage_v = {NAN, NAN}, .current_a = {NAN, NAN}};
      if (!meter) input.power_meter_w = NAN;
      if (!speed) input.speed_rad_s = NAN;
      if (const auto output = path.step(input)) last = *output;
    }
    return last;
  };
  const auto no_meter = with(true, false, true);
  EXPECT_EQ(no_meter.origin, TorquePath::Origin::kComputed);
  EXPECT_FALSE(no_meter.measured_power_valid);
  EXPECT_NEAR(no_meter.cutting_torque_nm, 10.0F, 0.01F);
  // P3's earlier method: drive power and speed alone.
  const auto no_motor = with(false, true, true);
  EXPECT_EQ(no_motor.origin, TorquePath::Origin::kMeasured);
  EXPECT_FALSE(no_motor.airgap_power_valid);
  EXPECT_NEAR(no_motor.cutting_torque_nm, 10.0F, 0.01F);
  EXPECT_TRUE(no_motor.in_cut);
  const auto no_power = with(false, false, true);
  EXPECT_FALSE(no_power.torque_valid);
  const auto nothing = with(false, false, false);
  EXPECT_FALSE(nothing.torque_valid || nothing.speed_valid);
}

TEST(TorquePath, CountsTheUncertaintyOfTheInertia) {
  auto sure = small_motor_path(TorquePath::Method::kComputed, 1000.0F);
  sure.speed = TorquePath::Speed::kSynchronous;
  auto unsure = sure;
  sure.inertia_sigma_ratio = 0.0F;
  unsure.inertia_sigma_ratio = 0.2F;
  float sigma[2];
  int at = 0;
  for (const auto& config : {sure, unsure}) {
    Rig rig{.config = config};
    auto path = TorquePath::make(config).value();
    (void)run(path, rig, 2.0F);
    rig.speed_rad_s += 1.0F;  // 0.6 N m of inertia within a window
    sigma[at++] = run(path, rig, 0.05F).cutting_torque_sigma_nm;
  }
  const float expected = 0.2F * 0.6F / 1.05F;
  EXPECT_NEAR(std::sqrt(sigma[1] * sigma[1] - sigma[0] * sigma[0]), expected, 0.1F * expected);
}

TEST(TorquePath, StartsItsWindowAnewAfterAGap) {
  Rig rig{.config = small_motor_path(TorquePath::Method::kComputed, 1000.0F)};
  auto path = TorquePath::make(rig.config).value();
  (void)run(path, rig, 3.0F);
  for (int k = 0; k < 20; ++k) EXPECT_FALSE(path.step(rig.sample()));
  path.restart();
  rig.speed_rad_s = 120.0F;  // another speed after the gap: no inertia may be invented
  for (int k = 1; k <= 50; ++k) {
    const auto output = path.step(rig.sample());
    ASSERT_EQ(output.has_value(), k == 50);
    if (output) {
      EXPECT_EQ(output->load_torque_nm, output->airgap_torque_nm);
      EXPECT_TRUE(output->tared);
    }
  }
}

TEST(TorquePath, RefusesWhatItCannotWorkWith) {
  using Error = TorquePath::ConfigError;
  const auto refused = [](auto change) {
    auto config = small_motor_path(TorquePath::Method::kComputed, 1000.0F);
    change(config);
    const auto made = TorquePath::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto&) {}), std::nullopt);
  EXPECT_EQ(refused([](auto& c) { c.power.power_factor_ratio = NAN; }), Error::kAirGapPower);
  EXPECT_EQ(refused([](auto& c) { c.synchronous.pole_pairs = 0.0F; }), Error::kSynchronousSpeed);
  EXPECT_EQ(refused([](auto& c) { c.meter.scale_ratio = NAN; }), Error::kMeasuredPower);
  EXPECT_EQ(refused([](auto& c) { c.drive.inertia_kg_m2 = -1.0F; }), Error::kDriveModel);
  EXPECT_EQ(refused([](auto& c) { c.load_friction.linear_ratio.value[0] = NAN; }),
            Error::kLoadFriction);
  EXPECT_EQ(refused([](auto& c) { c.tare.memory_s = 0.0F; }), Error::kIdleTare);
  EXPECT_EQ(refused([](auto& c) { c.monitor.hold_s = NAN; }), Error::kSynthesizedMonitor);
  EXPECT_EQ(refused([](auto& c) { c.tare.period_s = 0.01F; }), Error::kPeriods);
  EXPECT_EQ(refused([](auto& c) { c.synchronous.samples_per_window = 100; }), Error::kPeriods);
  EXPECT_EQ(refused([](auto& c) { c.rated_torque_nm = 0.0F; }), Error::kMotor);
  EXPECT_EQ(refused([](auto& c) { c.inertia_sigma_ratio = NAN; }), Error::kUncertainty);
  EXPECT_EQ(refused([](auto& c) { c.minimum_speed_rad_s = 0.0F; }), Error::kMinimumSpeed);
}

// Whatever comes in, no infinity and no NaN comes out, and the resumed copy follows bit for bit.
TEST(TorquePath, StaysFiniteAndContinuesBitExactlyFromASnapshotWithoutAllocating) {
  std::mt19937 random(12);
  std::uniform_real_distribution<float> draw(-1.0F, 1.0F);
  auto config = small_motor_path(TorquePath::Method::kSynthesized, 1000.0F);
  config.speed = TorquePath::Speed::kSlip;
  config.power.window = estimator::AirGapPower::Window::kElectricalPeriods;
  auto original = TorquePath::make(config).value();
  auto resumed = TorquePath::make(config).value();
  const auto allocations = allocation_count();
  for (int k = 0; k < 20000; ++k) {
    const float scale = k / 1000 % 4 == 0 ? 0.0F : 400.0F;
    const TorquePath::Input input{
        .motor = {.voltage_v = {scale * draw(random), scale * draw(random)},
                  .current_a = {0.1F * scale * draw(random), 0.1F * scale * draw(random)}},
        .speed_rad_s = scale * draw(random),
        .power_meter_w = 5.0F * scale * draw(random),
        .motor_valid = k / 300 % 5 != 0,
        .speed_valid = k / 700 % 3 != 0,
        .meter_valid = k / 500 % 4 != 0,
        .feed = Feed::kUnknown};
    resumed.restore(original.state());
    const auto a = original.step(input);
    const auto b = resumed.step(input);
    ASSERT_EQ(a.has_value(), b.has_value());
    if (!a) continue;
    for (const float value :
         {a->airgap_power_w, a->measured_power_w, a->airgap_torque_nm, a->load_torque_nm,
          a->cutting_torque_nm, a->cutting_torque_sigma_nm, a->speed_rad_s, a->synchronous_rad_s,
          a->idle_torque_nm, a->idle_torque_sigma_nm}) {
      ASSERT_TRUE(std::isfinite(value)) << k;
    }
    ASSERT_EQ(std::bit_cast<std::uint32_t>(a->cutting_torque_nm),
              std::bit_cast<std::uint32_t>(b->cutting_torque_nm));
    ASSERT_EQ(std::bit_cast<std::uint32_t>(a->cutting_torque_sigma_nm),
              std::bit_cast<std::uint32_t>(b->cutting_torque_sigma_nm));
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
