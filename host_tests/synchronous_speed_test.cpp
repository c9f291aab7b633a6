#include "estimator/synchronous_speed.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <complex>
#include <numbers>
#include <random>

#include "support/allocation_count.hpp"
#include "support/same_bits.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::MotorSample;
using estimator::SynchronousSpeed;

constexpr SynchronousSpeed::Config config_at(float rate_hz, SynchronousSpeed::Vector vector) {
  return {.sample_period_s = 1.0F / rate_hz,
          .samples_per_window = static_cast<std::uint32_t>(0.05F * rate_hz + 0.5F),
          .vector = vector,
          .pole_pairs = 2.0F,
          .stator_resistance_ohm = 3.7F,
          .leakage_inductance_h = 0.021F,
          .flux_leak_rad_s = 10.0F,
          .minimum_current_a = 0.1F,
          .minimum_electrical_rad_s = 10.0F};
}
static_assert(config_at(1000.0F, SynchronousSpeed::Vector::kFlux).check());

// A motor at constant flux: rotor flux of 1 V s along the real axis of a frame at w, and a current
// whose torque-making part may move.
MotorSample steady(double time_s, double w, double torque_a, double torque_a_s = 0.0) {
  using Complex = std::complex<double>;
  const Complex turn = std::polar(1.0, w * time_s);
  const Complex current = Complex(2.0, torque_a) * turn;
  const Complex flux = turn + 0.021 * current;
  const Complex voltage =
      3.7 * current + Complex(0.0, w) * flux + 0.021 * Complex(0.0, torque_a_s) * turn;
  return {.voltage_v = {static_cast<float>(voltage.real()), static_cast<float>(voltage.imag())},
          .current_a = {static_cast<float>(current.real()), static_cast<float>(current.imag())}};
}

TEST(SynchronousSpeed, FollowsCurrentAndFluxAtAnyRateAndInBothDirections) {
  for (const auto vector : {SynchronousSpeed::Vector::kCurrent, SynchronousSpeed::Vector::kFlux}) {
    for (const float rate_hz : {1000.0F, 5000.0F, 20000.0F}) {
      for (const double w : {-600.0, -62.8, 31.4, 314.2, 1000.0}) {
        auto speed = SynchronousSpeed::make(config_at(rate_hz, vector)).value();
        SynchronousSpeed::Output output{};
        const double period_s = 1.0 / static_cast<double>(rate_hz);
        for (int k = 0; k < static_cast<int>(1.5 * static_cast<double>(rate_hz)); ++k) {
          if (const auto now = speed.step(steady(k * period_s, w, 3.0))) output = *now;
        }
        EXPECT_TRUE(output.valid);
        EXPECT_NEAR(output.electrical_rad_s, w, 2e-4 * std::abs(w)) << rate_hz << ' ' << w;
        EXPECT_NEAR(output.synchronous_rad_s, 0.5 * w, 2e-4 * std::abs(w));
        EXPECT_NEAR(output.synchronous_end_rad_s, 0.5 * w, 1e-3 * std::abs(w));
      }
    }
  }
}

// 1 kHz and 50 Hz: the trapezoidal rule makes the flux 0.8 % too small, its square 1.7 %.
TEST(SynchronousSpeed, FindsTheMagnitudeOfTheFlux) {
  auto speed = SynchronousSpeed::make(config_at(1000.0F, SynchronousSpeed::Vector::kFlux)).value();
  SynchronousSpeed::Output output{};
  for (int k = 0; k < 1500; ++k) {
    if (const auto now = speed.step(steady(k * 1e-3, 314.16, 3.0))) output = *now;
  }
  EXPECT_NEAR(output.flux_square_v2s2, 1.0F, 0.03F);
}

// A step of the load turns the current against the flux: only the current's rotation sees it.
TEST(SynchronousSpeed, DoesNotTakeALoadStepForSpeedWhenItFollowsTheFlux) {
  for (const auto vector : {SynchronousSpeed::Vector::kCurrent, SynchronousSpeed::Vector::kFlux}) {
    auto speed = SynchronousSpeed::make(config_at(5000.0F, vector)).value();
    float worst = 0.0F;
    for (int k = 0; k < 10000; ++k) {
      // 3.5 A within 10 ms.
      const double torque_a = 0.5 + std::clamp(0.07 * (k - 7600), 0.0, 3.5);
      const double torque_a_s = k >= 7600 && k <= 7650 ? 350.0 : 0.0;
      const auto output = speed.step(steady(k * 2e-4, 314.16, torque_a, torque_a_s));
      if (output && k > 7000) {
        worst = std::max(worst, std::abs(output->electrical_rad_s - 314.16F));
      }
    }
    if (vector == SynchronousSpeed::Vector::kCurrent) {
      EXPECT_GT(worst, 10.0F);
    } else {
      EXPECT_LT(worst, 1.0F);
    }
  }
}

// (E29) is the root of w_s = w_M + k P_g / w_s.
TEST(SynchronousSpeed, FromSlipSolvesItsOwnEquation) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> draw(0.0F, 1.0F);
  for (int k = 0; k < 1000; ++k) {
    const float rotor = 20.0F + 300.0F * draw(random);
    const float power = -500.0F + 5000.0F * draw(random);
    const float ws = estimator::synchronous_speed_from_slip(rotor, power, 2.1F, 2.0F, 0.9F);
    const float gain = 2.1F / (1.5F * 4.0F * 0.9F);
    EXPECT_NEAR(ws, rotor + gain * power / ws, 1e-4F * ws);
    EXPECT_EQ(estimator::synchronous_speed_from_slip(-rotor, power, 2.1F, 2.0F, 0.9F), -ws);
  }
  // A brake stronger than any induction motor's: no square root of a negative number.
  EXPECT_EQ(estimator::synchronous_speed_from_slip(10.0F, -1e6F, 2.1F, 2.0F, 0.9F), 5.0F);
}

TEST(SynchronousSpeed, IsNotValidWithoutCurrentOrRotation) {
  const auto config = config_at(1000.0F, SynchronousSpeed::Vector::kFlux);
  auto dead = SynchronousSpeed::make(config).value();
  auto still = SynchronousSpeed::make(config).value();
  for (int k = 0; k < 500; ++k) {
    const auto a = dead.step({});
    const auto b = still.step(steady(0.0, 0.0, 3.0));
    if (a) {
      EXPECT_FALSE(a->valid);
    }
    if (b) {
      EXPECT_FALSE(b->valid);
    }
    if (a) {
      EXPECT_TRUE(std::isfinite(a->flux_square_v2s2));
    }
  }
}

TEST(SynchronousSpeed, RefusesWhatItCannotWorkWith) {
  using Error = SynchronousSpeed::ConfigError;
  const auto refused = [](auto change) {
    auto config = config_at(1000.0F, SynchronousSpeed::Vector::kFlux);
    change(config);
    const auto made = SynchronousSpeed::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.sample_period_s = NAN; }), Error::kSamplePeriod);
  EXPECT_EQ(refused([](auto& c) { c.samples_per_window = 4; }), Error::kWindow);
  EXPECT_EQ(refused([](auto& c) { c.pole_pairs = 0.0F; }), Error::kPolePairs);
  EXPECT_EQ(refused([](auto& c) { c.leakage_inductance_h = NAN; }), Error::kMotor);
  EXPECT_EQ(refused([](auto& c) { c.stator_resistance_ohm = -1.0F; }), Error::kMotor);
  EXPECT_EQ(refused([](auto& c) { c.flux_leak_rad_s = 0.0F; }), Error::kLeak);
  EXPECT_EQ(refused([](auto& c) { c.flux_leak_rad_s = 2000.0F; }), Error::kLeak);
  EXPECT_EQ(refused([](auto& c) { c.minimum_electrical_rad_s = 0.0F; }), Error::kLimits);
}

TEST(SynchronousSpeed, GivesTheSameInRunsAsSampleBySample) {
  for (const auto vector : {SynchronousSpeed::Vector::kFlux, SynchronousSpeed::Vector::kCurrent}) {
    const auto config = config_at(1000.0F, vector);
    auto singly = SynchronousSpeed::make(config).value();
    auto in_runs = singly;
    for (int k = 0; k < 5000;) {
      std::array<MotorSample, 5> run{};  // of 50 samples a window
      bool ends = false;
      for (MotorSample& sample : run) {
        sample = steady(k * 1e-3, 200.0, 2.0 + 1e-4 * k);
        ++k;
        ends = singly.add(sample);
      }
      ASSERT_EQ(in_runs.add_run(run), ends) << k;
      if (ends) {
        const auto a = singly.close_window();
        const auto b = in_runs.close_window();
        ASSERT_TRUE(same_bits(a.electrical_rad_s, b.electrical_rad_s)) << k;
        ASSERT_TRUE(same_bits(a.flux_square_v2s2, b.flux_square_v2s2)) << k;
      }
      ASSERT_TRUE(same_bits(singly.state(), in_runs.state())) << k;
    }
  }
}

TEST(SynchronousSpeed, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  const auto config = config_at(1000.0F, SynchronousSpeed::Vector::kFlux);
  auto original = SynchronousSpeed::make(config).value();
  auto resumed = SynchronousSpeed::make(config).value();
  const auto allocations = allocation_count();
  for (int k = 0; k < 1000; ++k) {
    resumed.restore(original.state());
    const auto sample = steady(k * 1e-3, 200.0, 2.0 + 1e-3 * k);
    const auto a = original.step(sample);
    const auto b = resumed.step(sample);
    if (a) {
      ASSERT_EQ(std::bit_cast<std::uint32_t>(a->electrical_rad_s),
                std::bit_cast<std::uint32_t>(b->electrical_rad_s));
    }
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
