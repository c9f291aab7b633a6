#include "estimator/air_gap_power.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <random>
#include <vector>

#include "support/allocation_count.hpp"
#include "support/same_bits.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::AirGapPower;
using estimator::MotorSample;
using estimator::SpaceVector;

constexpr AirGapPower::Config kConfig{.sample_period_s = 1e-3F,
                                      .samples_per_window = 50,
                                      .stator_resistance_ohm = 0.5F,
                                      .mode = AirGapPower::Mode::kDotProduct,
                                      .power_factor_ratio = 0.8660254F,
                                      .window = AirGapPower::Window::kTime};
static_assert(kConfig.check());

// Balanced and sinusoidal: current lags by `lag_rad`; offsets on top.
MotorSample sinusoid(double time_s, double hz, double lag_rad, double offset_a = 0.0) {
  const double angle = 2.0 * std::numbers::pi * hz * time_s;
  return {.voltage_v = {static_cast<float>(300.0 * std::cos(angle)),
                        static_cast<float>(300.0 * std::sin(angle))},
          .current_a = {static_cast<float>(10.0 * std::cos(angle - lag_rad) + offset_a),
                        static_cast<float>(10.0 * std::sin(angle - lag_rad))}};
}

AirGapPower::Output last_window(AirGapPower& power, double hz, double lag_rad, double offset_a,
                                int windows) {
  AirGapPower::Output last{};
  for (int k = 1; k <= windows * 50; ++k) {
    const auto output =
        power.step({.sample = sinusoid(k * 1e-3, hz, lag_rad, offset_a),
                    .electrical_rad_s = static_cast<float>(2.0 * std::numbers::pi * hz)});
    EXPECT_EQ(output.has_value(), k % 50 == 0) << k;
    if (output) last = *output;
  }
  return last;
}

// The identities of the three ways to write input power, at random phase quantities without
// any symmetry, in double: they are algebra. A three-wire machine: the currents sum to zero.
TEST(AirGapPower, IsTheSameByTwoWattmetersDotProductAndDeltaWinding) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> draw(-500.0, 500.0);
  for (int k = 0; k < 1000; ++k) {
    const double vu = draw(random), vv = draw(random), vw = draw(random);
    const double iu = draw(random), iv = draw(random), iw = -iu - iv;
    const double uv = vu - vv, vw_line = vv - vw, wu = vw - vu;
    const double phases = vu * iu + vv * iv + vw * iw;
    const double wattmeters = -wu * iu + vw_line * iv;
    const double delta = (uv * (iu - iv) + vw_line * (iv - iw) + wu * (iw - iu)) / 3.0;
    const double va = (2.0 * vu - vv - vw) / 3.0, vb = (vv - vw) / std::sqrt(3.0);
    const double ia = (2.0 * iu - iv - iw) / 3.0, ib = (iv - iw) / std::sqrt(3.0);
    const double dot = 1.5 * (va * ia + vb * ib);
    const double scale = std::abs(va * ia) + std::abs(vb * ib) + 1.0;
    EXPECT_NEAR(wattmeters, phases, 1e-9 * scale);
    EXPECT_NEAR(delta, phases, 1e-9 * scale);
    EXPECT_NEAR(dot, phases, 1e-9 * scale);
    // Copper loss of a delta winding of R per phase is that of a star of R/3.
    const double delta_squares =
        ((iu - iv) * (iu - iv) + (iv - iw) * (iv - iw) + (iw - iu) * (iw - iu)) / 9.0;
    EXPECT_NEAR(delta_squares, 1.5 * (ia * ia + ib * ib) / 3.0, 1e-9 * scale);
  }
}

TEST(AirGapPower, TakesTheCopperLossFromASteadyInput) {
  auto power = AirGapPower::make(kConfig).value();
  const auto output = last_window(power, 50.0, 0.6435, 0.0, 2);
  const float input_w = 1.5F * 300.0F * 10.0F * 0.8F;
  EXPECT_NEAR(output.input_power_w, input_w, 0.05F);
  EXPECT_NEAR(output.airgap_power_w, input_w - 1.5F * 0.5F * 100.0F, 0.05F);
  EXPECT_NEAR(output.current_square_a2, 100.0F, 1e-3F);
  EXPECT_LT(output.noise_variance_w2, 1e-3F);
}

// What P3 (3) does: right at a power factor of 0.866 only.
TEST(AirGapPower, ReproducesTheFixedPowerFactorWithItsError) {
  auto config = kConfig;
  config.mode = AirGapPower::Mode::kFixedPowerFactor;
  for (const double factor : {0.2, 0.8, 0.8660254}) {
    auto power = AirGapPower::make(config).value();
    const auto output = last_window(power, 50.0, std::acos(factor), 0.0, 1);
    EXPECT_NEAR(output.input_power_w, 4500.0F * 0.8660254F, 0.1F);
  }
}

// A DC offset of the current makes the power beat at the stator frequency. 46 Hz: 2.3 periods in
// the window.
TEST(AirGapPower, LosesTheRippleOfOffsetsInWholePeriods) {
  const float expected_w = 1.5F * 300.0F * 10.0F * 0.8F;
  auto config = kConfig;
  config.stator_resistance_ohm = 0.0F;
  auto plain = AirGapPower::make(config).value();
  const auto by_time = last_window(plain, 46.0, 0.6435, 1.0, 4);
  config.window = AirGapPower::Window::kElectricalPeriods;
  auto whole = AirGapPower::make(config).value();
  const auto by_periods = last_window(whole, 46.0, 0.6435, 1.0, 4);
  EXPECT_GT(std::abs(by_time.airgap_power_w - expected_w), 20.0F);
  EXPECT_LT(std::abs(by_periods.airgap_power_w - expected_w), 2.0F);
}

// Less than a period, standstill, no number: the window of time.
TEST(AirGapPower, FallsBackToTheWindowOfTime) {
  auto config = kConfig;
  auto plain = AirGapPower::make(config).value();
  config.window = AirGapPower::Window::kElectricalPeriods;
  for (const float electrical : {0.0F, 100.0F, NAN, INFINITY, -1e9F}) {
    auto whole = AirGapPower::make(config).value();
    for (int k = 1; k <= 50; ++k) {
      const AirGapPower::Input input{.sample = sinusoid(k * 1e-3, 12.0, 0.3),
                                     .electrical_rad_s = electrical};
      const auto a = plain.step(input);
      const auto b = whole.step(input);
      if (a) {
        EXPECT_EQ(a->airgap_power_w, b->airgap_power_w) << electrical;
      }
    }
    plain.restart();
  }
}

TEST(AirGapPower, StatesTheScatterOfItsMean) {
  std::mt19937 random(2);
  std::normal_distribution<float> noise(0.0F, 40.0F);
  auto config = kConfig;
  config.stator_resistance_ohm = 0.0F;
  auto power = AirGapPower::make(config).value();
  double stated = 0.0;
  double seen = 0.0;
  int windows = 0;
  for (int k = 0; k < 100000; ++k) {
    // A ramp of power within the window must not count as noise.
    const float watt = 1000.0F + 2.0F * static_cast<float>(k % 50) + noise(random);
    const auto output =
        power.step({.sample = {.voltage_v = {watt / 1.5F, 0.0F}, .current_a = {1.0F, 0.0F}},
                    .electrical_rad_s = 0.0F});
    if (!output || k < 50) continue;
    // The saw tooth falls from 98 to 0 between windows, inside the first trapezoid.
    const double error = static_cast<double>(output->airgap_power_w) - 1049.0;
    stated += static_cast<double>(output->noise_variance_w2);
    seen += error * error;
    ++windows;
  }
  EXPECT_NEAR(std::sqrt(stated / seen), 1.0, 0.12);
  EXPECT_GT(windows, 1900);
}

TEST(AirGapPower, RefusesWhatItCannotWorkWith) {
  using Error = AirGapPower::ConfigError;
  const auto refused = [](auto change) {
    auto config = kConfig;
    change(config);
    const auto made = AirGapPower::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.sample_period_s = NAN; }), Error::kSamplePeriod);
  EXPECT_EQ(refused([](auto& c) { c.sample_period_s = 0.0F; }), Error::kSamplePeriod);
  EXPECT_EQ(refused([](auto& c) { c.samples_per_window = 1; }), Error::kWindow);
  EXPECT_EQ(refused([](auto& c) { c.stator_resistance_ohm = -0.1F; }), Error::kResistance);
  EXPECT_EQ(refused([](auto& c) { c.stator_resistance_ohm = NAN; }), Error::kResistance);
  EXPECT_EQ(refused([](auto& c) { c.power_factor_ratio = 1.1F; }), Error::kPowerFactor);
}

// Turning the frame or the phase sequence changes no power.
TEST(AirGapPower, DoesNotDependOnTheFrame) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> draw(-300.0F, 300.0F);
  auto plain = AirGapPower::make(kConfig).value();
  auto turned = AirGapPower::make(kConfig).value();
  const auto turn = [](SpaceVector v) {
    return SpaceVector{0.6F * v.alpha - 0.8F * v.beta, 0.8F * v.alpha + 0.6F * v.beta};
  };
  for (int k = 0; k < 5000; ++k) {
    const MotorSample sample{.voltage_v = {draw(random), draw(random)},
                             .current_a = {0.1F * draw(random), 0.1F * draw(random)}};
    const auto a = plain.step({.sample = sample, .electrical_rad_s = 0.0F});
    const auto b = turned.step(
        {.sample = {.voltage_v = turn(sample.voltage_v), .current_a = turn(sample.current_a)},
         .electrical_rad_s = 0.0F});
    if (a) {
      EXPECT_NEAR(a->airgap_power_w, b->airgap_power_w, 0.05F);
    }
  }
}

TEST(AirGapPower, GivesTheSameInRunsAsSampleBySample) {
  std::mt19937 random(19);
  for (const auto mode : {AirGapPower::Mode::kDotProduct, AirGapPower::Mode::kFixedPowerFactor}) {
    for (const auto window :
         {AirGapPower::Window::kTime, AirGapPower::Window::kElectricalPeriods}) {
      auto config = kConfig;
      config.mode = mode;
      config.window = window;
      auto singly = AirGapPower::make(config).value();
      auto in_runs = singly;
      int windows = 0;
      for (int k = 0; k < 5000;) {
        const std::uint32_t left = in_runs.samples_left();
        ASSERT_GT(left, 0U);
        std::vector<MotorSample> run(std::min<std::size_t>(1 + random() % 8, left));
        bool ends = false;
        for (MotorSample& sample : run) {
          ASSERT_FALSE(ends) << k;
          sample = sinusoid(k++ * 1e-3, 46.0, 0.5, 0.3);
          ends = singly.add(sample, 289.0F);
        }
        ASSERT_EQ(in_runs.add_run(run, 289.0F), ends) << k;
        ASSERT_TRUE(same_bits(singly.state(), in_runs.state())) << k;
        if (!ends) continue;
        ++windows;
        ASSERT_TRUE(same_bits(singly.close_window(), in_runs.close_window())) << k;
      }
      EXPECT_GT(windows, 10);
    }
  }
}

TEST(AirGapPower, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  auto config = kConfig;
  config.window = AirGapPower::Window::kElectricalPeriods;
  auto original = AirGapPower::make(config).value();
  auto resumed = AirGapPower::make(config).value();
  const auto allocations = allocation_count();
  for (int k = 0; k < 1000; ++k) {
    const AirGapPower::Input input{.sample = sinusoid(k * 1e-3, 46.0, 0.5, 0.3),
                                   .electrical_rad_s = 289.0F};
    resumed.restore(original.state());
    const auto a = original.step(input);
    const auto b = resumed.step(input);
    ASSERT_EQ(a.has_value(), b.has_value());
    if (a) {
      ASSERT_EQ(std::bit_cast<std::uint32_t>(a->airgap_power_w),
                std::bit_cast<std::uint32_t>(b->airgap_power_w));
    }
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
