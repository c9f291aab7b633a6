#include "estimator/front_end.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <random>

#if __has_include("support/allocation_count.hpp")
#include "support/allocation_count.hpp"
#define CUTFORCE_COUNTS_ALLOCATIONS
#endif

namespace cutforce {
namespace {

using estimator::Calibration;
using estimator::CurrentChannels;
using estimator::FrontEnd;
using estimator::MotorSample;
using estimator::VoltageChannels;
using Complex = std::complex<double>;

constexpr double kPi = std::numbers::pi;
constexpr Calibration kPerfect{.voltage_gain_ratio = {1.0F, 1.0F, 1.0F},
                               .voltage_offset_v = {0.0F, 0.0F, 0.0F},
                               .current_gain_ratio = {1.0F, 1.0F, 1.0F},
                               .current_offset_a = {0.0F, 0.0F, 0.0F}};
constexpr FrontEnd::Config kStar{.voltages = VoltageChannels::kLineToNeutral,
                                 .currents = CurrentChannels::kThree,
                                 .calibration = kPerfect};
static_assert(kStar.check());

struct Wires {
  std::array<double, 3> v;  // to neutral, sum 0
  std::array<double, 3> i;  // sum 0
};

Wires random_wires(std::mt19937& random) {
  std::uniform_real_distribution<double> volt(-400.0, 400.0);
  std::uniform_real_distribution<double> ampere(-30.0, 30.0);
  Wires w{.v = {volt(random), volt(random), 0.0}, .i = {ampere(random), ampere(random), 0.0}};
  w.v[2] = -w.v[0] - w.v[1];
  w.i[2] = -w.i[0] - w.i[1];
  return w;
}

Wires balanced(double v_peak, double i_peak, double angle, double lag) {
  Wires w{};
  for (std::size_t k = 0; k < 3; ++k) {
    const double shift = 2.0 * kPi / 3.0 * static_cast<double>(k);
    w.v[k] = v_peak * std::cos(angle - shift);
    w.i[k] = i_peak * std::cos(angle - lag - shift);
  }
  return w;
}

FrontEnd::Input channels(const Wires& w, VoltageChannels kind) {
  const auto f = [](double x) { return static_cast<float>(x); };
  const auto& v = w.v;
  FrontEnd::Input in{.voltage_v = {f(v[0]), f(v[1]), f(v[2])},
                     .current_a = {f(w.i[0]), f(w.i[1]), f(w.i[2])}};
  if (kind != VoltageChannels::kLineToNeutral)
    in.voltage_v = {f(v[0] - v[1]), f(v[1] - v[2]), f(v[2] - v[0])};
  return in;
}

double dot_power(const Wires& w) { return w.v[0] * w.i[0] + w.v[1] * w.i[1] + w.v[2] * w.i[2]; }

double vector_power(const MotorSample& s) {
  return 1.5 * static_cast<double>(estimator::dot(s.voltage_v, s.current_a));
}

TEST(FrontEnd, KeepsThePowerOfAnyThreeWireSignalInEveryWiringOfTheSensors) {
  std::mt19937 random(1);
  double worst = 0.0;
  for (int n = 0; n < 20000; ++n) {
    const Wires w = random_wires(random);
    const auto& [v, i] = w;
    const double two_wattmeter = -(v[2] - v[0]) * i[0] + (v[1] - v[2]) * i[1];
    ASSERT_NEAR(two_wattmeter, dot_power(w), 1e-9);
    for (const auto kind : {VoltageChannels::kLineToNeutral, VoltageChannels::kLineToLine,
                            VoltageChannels::kTwoLineToLine}) {
      for (const auto currents : {CurrentChannels::kThree, CurrentChannels::kTwo}) {
        const auto block = FrontEnd::make({kind, currents, kPerfect}).value();
        const double p = vector_power(block.step(channels(w, kind)).motor);
        worst = std::max(worst, std::fabs(p - dot_power(w)));
      }
    }
  }
  // Six products of up to 400 V * 30 A, each rounded to 24 bits.
  EXPECT_LT(worst, 72000.0 * static_cast<double>(std::numeric_limits<float>::epsilon()));
}

TEST(FrontEnd, KeepsThePowerOfADeltaWindingWithoutKnowingOfIt) {
  std::mt19937 random(2);
  for (int n = 0; n < 1000; ++n) {
    const auto& [v, i] = random_wires(random);
    double delta = 0.0;
    double phase_squares = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t next = (k + 1) % 3;
      const double phase_a = (i[k] - i[next]) / 3.0;
      delta += (v[k] - v[next]) * phase_a;
      phase_squares += phase_a * phase_a;
    }
    ASSERT_NEAR(delta, dot_power({v, i}), 1e-9);
    const double line_squares = i[0] * i[0] + i[1] * i[1] + i[2] * i[2];
    const double star_ohm = static_cast<double>(estimator::star_equivalent_resistance(0.75F));
    ASSERT_NEAR(0.75 * phase_squares, star_ohm * line_squares, 1e-9);
  }
}

// Line currents scaled by 1/sqrt(3) but not turned by 30 degrees: the error of P3 as it is read
// most easily. cos(66.87 deg)/cos(36.87 deg) = 0.491 of the true power at power factor 0.8.
TEST(FrontEnd, ShowsWhatADeltaWithoutRotationCosts) {
  const double lag = std::acos(0.8);
  for (double angle = 0.0; angle < 6.28; angle += 0.1) {
    const Wires w = balanced(163.3, 35.36, angle, lag);
    double wrong = 0.0;
    for (std::size_t k = 0; k < 3; ++k)
      wrong += (w.v[k] - w.v[(k + 1) % 3]) * w.i[k] / std::sqrt(3.0);
    const double expected = std::cos(lag + kPi / 6.0) / std::cos(lag);
    ASSERT_NEAR(wrong / dot_power(w), expected, 1e-9);
    ASSERT_NEAR(wrong / dot_power(w) - 1.0, -0.509, 5e-4);
  }
}

TEST(FrontEnd, MeetsTheInstantaneousRmsIdentityAndTurnsBalancedSetsIntoOneLength) {
  const auto block = FrontEnd::make(kStar).value();
  for (double angle = 0.0; angle < 6.28; angle += 0.01) {
    const Wires w = balanced(325.0, 7.0, angle, 0.6);
    ASSERT_NEAR(w.v[0] * w.v[0] + w.v[1] * w.v[1] + w.v[2] * w.v[2], 1.5 * 325.0 * 325.0,
                1e-9 * 1e5);
    const auto out = block.step(channels(w, kStar.voltages));
    ASSERT_NEAR(out.motor.voltage_v.alpha, 325.0 * std::cos(angle), 1e-4);
    ASSERT_NEAR(out.motor.voltage_v.beta, 325.0 * std::sin(angle), 1e-4);
    ASSERT_NEAR(out.motor.current_a.beta, 7.0 * std::sin(angle - 0.6), 1e-5);
    ASSERT_NEAR(out.current_residual_a, 0.0, 1e-5);
  }
}

TEST(FrontEnd, UndoesGainOffsetAndLeadOfTheSensors) {
  const Calibration calibration{.voltage_gain_ratio = {1.02F, 0.97F, 1.01F},
                                .voltage_offset_v = {3.0F, -2.0F, 1.0F},
                                .current_gain_ratio = {0.99F, 1.03F, 1.0F},
                                .current_offset_a = {0.1F, -0.2F, 0.05F}};
  constexpr double kLead = 0.1;  // rad at this frequency
  for (const auto currents : {CurrentChannels::kThree, CurrentChannels::kTwo}) {
    for (const auto kind : {VoltageChannels::kLineToNeutral, VoltageChannels::kLineToLine,
                            VoltageChannels::kTwoLineToLine}) {
      auto block = FrontEnd::make({kind, currents, kPerfect}).value();
      ASSERT_TRUE(block.set_calibration(calibration));
      block.set_rotation(std::cos(static_cast<float>(kLead)), std::sin(static_cast<float>(kLead)));
      for (double angle = 0.0; angle < 6.28; angle += 0.1) {
        const Wires now = balanced(300.0, 5.0, angle, 0.9);
        const Wires ahead = balanced(300.0, 5.0, angle + kLead, 0.9);
        FrontEnd::Input in = channels({ahead.v, now.i}, kind);
        for (std::size_t k = 0; k < 3; ++k) {
          in.voltage_v[k] =
              in.voltage_v[k] / calibration.voltage_gain_ratio[k] + calibration.voltage_offset_v[k];
          in.current_a[k] =
              in.current_a[k] / calibration.current_gain_ratio[k] + calibration.current_offset_a[k];
        }
        const auto out = block.step(in);
        ASSERT_NEAR(out.motor.voltage_v.alpha, 300.0 * std::cos(angle), 2e-4);
        ASSERT_NEAR(out.motor.voltage_v.beta, 300.0 * std::sin(angle), 2e-4);
        ASSERT_NEAR(out.motor.current_a.alpha, 5.0 * std::cos(angle - 0.9), 5e-6);
        ASSERT_NEAR(out.motor.current_a.beta, 5.0 * std::sin(angle - 0.9), 5e-6);
      }
    }
  }
}

TEST(FrontEnd, NeverReadsAChannelThatIsNotMeasured) {
  const auto block =
      FrontEnd::make({VoltageChannels::kTwoLineToLine, CurrentChannels::kTwo, kPerfect}).value();
  const auto a = block.step({{1.0F, 2.0F, 0.0F}, {3.0F, 4.0F, 0.0F}});
  const auto b = block.step({{1.0F, 2.0F, 77.0F}, {3.0F, 4.0F, -99.0F}});
  EXPECT_EQ(a.motor.voltage_v.alpha, b.motor.voltage_v.alpha);
  EXPECT_EQ(a.motor.voltage_v.beta, b.motor.voltage_v.beta);
  EXPECT_EQ(a.motor.current_a.alpha, b.motor.current_a.alpha);
  EXPECT_EQ(a.motor.current_a.beta, b.motor.current_a.beta);
  EXPECT_EQ(b.current_residual_a, 0.0F);
}

TEST(FrontEnd, ShowsACurrentThatTheSumRuleForbids) {
  const auto block = FrontEnd::make(kStar).value();
  EXPECT_NEAR(block.step({{}, {1.0F, 2.0F, -2.5F}}).current_residual_a, 0.5F, 1e-6F);
}

TEST(FrontEnd, RefusesGainsAndOffsetsThatAreNoNumbers) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  using Error = FrontEnd::ConfigError;
  for (std::size_t k = 0; k < 3; ++k) {
    for (const float bad : {kNan, kInf, -kInf, 0.0F, 1e-30F, -1e-30F, 1e30F, -1e30F}) {
      Calibration c = kPerfect;
      c.voltage_gain_ratio[k] = bad;
      EXPECT_EQ(FrontEnd::make({kStar.voltages, kStar.currents, c}).error(), Error::kVoltageGain);
      c = kPerfect;
      c.current_gain_ratio[k] = bad;
      EXPECT_EQ(FrontEnd::make({kStar.voltages, kStar.currents, c}).error(), Error::kCurrentGain);
    }
    for (const float bad : {kNan, kInf, -kInf, 1e30F}) {
      Calibration c = kPerfect;
      c.voltage_offset_v[k] = bad;
      EXPECT_EQ(FrontEnd::make({kStar.voltages, kStar.currents, c}).error(), Error::kVoltageOffset);
      c = kPerfect;
      c.current_offset_a[k] = bad;
      auto block = FrontEnd::make(kStar).value();
      EXPECT_EQ(block.set_calibration(c).error(), Error::kCurrentOffset);
      EXPECT_EQ(block.state().calibration, kPerfect) << "a refused calibration must leave the old";
    }
  }
}

TEST(FrontEnd, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> wobble(0.95F, 1.05F);
  auto original = FrontEnd::make(kStar).value();
  auto resumed = FrontEnd::make(kStar).value();
#ifdef CUTFORCE_COUNTS_ALLOCATIONS
  const auto allocations = host_tests::allocation_count();
#endif
  for (int n = 0; n < 2000; ++n) {
    if (n % 100 == 0) {
      Calibration c = kPerfect;
      for (float& g : c.voltage_gain_ratio) g = wobble(random);
      for (float& o : c.current_offset_a) o = wobble(random) - 1.0F;
      if (!original.set_calibration(c)) FAIL();
      original.set_rotation(0.6F, 0.8F);
    }
    resumed.restore(original.state());
    const auto in = channels(random_wires(random), kStar.voltages);
    const auto a = std::bit_cast<std::array<std::uint32_t, 5>>(original.step(in));
    const auto b = std::bit_cast<std::array<std::uint32_t, 5>>(resumed.step(in));
    ASSERT_TRUE(a == b) << n;
  }
#ifdef CUTFORCE_COUNTS_ALLOCATIONS
  EXPECT_EQ(host_tests::allocation_count(), allocations);
#endif
}

}  // namespace
}  // namespace cutforce
