#include "estimator/flux_torque.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include "support/allocation_count.hpp"
#include "support/random_float.hpp"
#include "support/same_bits.hpp"

namespace cutforce::host_tests {
namespace {

using Complex = std::complex<double>;
using estimator::FluxTorque;
using estimator::MotorSample;
using estimator::SpaceVector;

constexpr double kResistance = 3.7;
constexpr double kPolePairs = 2.0;

constexpr FluxTorque::Config config_at(double rate_hz) {
  return {.sample_period_s = static_cast<float>(1.0 / rate_hz),
          .pole_pairs = 2.0F,
          .stator_resistance_ohm = 3.7F,
          .leak_ratio = 0.2F};
}
static_assert(config_at(1000.0).check());

// Any steady state: a flux and a current that turn together, and the torque they make.
struct Steady {
  double frequency_rad_s;
  Complex flux_v_s{0.95, 0.0};
  Complex current_a{3.0, 5.0};

  [[nodiscard]] MotorSample at(double time_s, Complex offset_v = {}, Complex offset_a = {}) const {
    const Complex turn = std::polar(1.0, frequency_rad_s * time_s);
    const Complex i = current_a * turn;
    const Complex v = kResistance * i + Complex(0.0, frequency_rad_s) * flux_v_s * turn + offset_v;
    const Complex seen = i + offset_a;
    return {.voltage_v = {static_cast<float>(v.real()), static_cast<float>(v.imag())},
            .current_a = {static_cast<float>(seen.real()), static_cast<float>(seen.imag())}};
  }
  [[nodiscard]] double torque_nm() const {
    return 1.5 * kPolePairs * (std::conj(flux_v_s) * current_a).imag();
  }
};

SpaceVector vector_of(Complex z) {
  return {static_cast<float>(z.real()), static_cast<float>(z.imag())};
}

// (E64): no error of discretisation, however few samples a period has. Without the correction the
// trapezoid alone makes 3.4 % at 1 kHz and 100 Hz, and the leak turns the flux by 11 degrees.
TEST(FluxTorque, IsExactForASinusoidAtAnyRateAndInBothDirections) {
  for (const double rate_hz : {1000.0, 5000.0, 20000.0}) {
    for (const double hz : {-100.0, -10.0, 5.0, 10.0, 50.0, 150.0}) {
      const Steady motor{.frequency_rad_s = 2.0 * std::numbers::pi * hz};
      auto flux = FluxTorque::make(config_at(rate_hz)).value();
      flux.set_frequency(static_cast<float>(motor.frequency_rad_s));
      const int samples = static_cast<int>(1.5 * rate_hz);
      for (int k = 0; k < samples; ++k) {
        flux.step(motor.at(k / rate_hz), 1.0F);
        if (k == samples - static_cast<int>(0.2 * rate_hz)) static_cast<void>(flux.take());
      }
      EXPECT_NEAR(flux.take().torque_nm, motor.torque_nm(), 1e-3 * motor.torque_nm())
          << rate_hz << " Hz, " << hz;
    }
  }
}

// The frequency a little off costs as little: it only sets the correction of the leak.
TEST(FluxTorque, ForgivesAFrequencyThatIsALittleWrong) {
  const Steady motor{.frequency_rad_s = 314.159};
  auto flux = FluxTorque::make(config_at(5000.0)).value();
  flux.set_frequency(0.995F * 314.159F);
  for (int k = 0; k < 5000; ++k) flux.step(motor.at(k * 2e-4), 1.0F);
  EXPECT_NEAR(flux.take().torque_nm, motor.torque_nm(), 3e-3 * motor.torque_nm());
}

TEST(FluxTorque, StaysExactWhereSamplesAreMissing) {
  const Steady motor{.frequency_rad_s = 314.159};
  auto flux = FluxTorque::make(config_at(5000.0)).value();
  flux.set_frequency(314.159F);
  std::mt19937 random(3);
  std::uniform_int_distribution<int> missing(0, 4);
  int at = 0;
  for (int k = 0; k < 8000; ++k) {
    const int elapsed = 1 + missing(random);
    at += elapsed;
    flux.step(motor.at(at * 2e-4), static_cast<float>(elapsed));
    if (k > 2000) {
      ASSERT_NEAR(flux.state().torque_nm, motor.torque_nm(), 1e-3 * motor.torque_nm()) << k;
    }
  }
}

// 10 ms at 50 Hz is half a turn: the sinusoid is not resolved, the steady state is taken instead.
TEST(FluxTorque, StartsAnewFromTheSteadyStateAfterAGapThatItCannotBridge) {
  const Steady motor{.frequency_rad_s = -314.159};
  auto flux = FluxTorque::make(config_at(5000.0)).value();
  flux.set_frequency(-314.159F);
  for (int k = 0; k < 3; ++k) flux.step(motor.at(k * 2e-4), 1.0F);
  flux.step(motor.at(0.5), 2498.0F);
  EXPECT_NEAR(flux.state().torque_nm, motor.torque_nm(), 1e-4 * motor.torque_nm());
}

TEST(FluxTorque, SeedSetsTheFluxOfTheSteadyStateAndNothingNearStandstill) {
  const Steady motor{.frequency_rad_s = 200.0};
  auto flux = FluxTorque::make(config_at(5000.0)).value();
  flux.set_frequency(200.0F);
  flux.step(motor.at(0.0), 1.0F);
  flux.seed();
  EXPECT_NEAR(flux.state().flux_v_s.alpha, 0.95, 1e-5);
  EXPECT_NEAR(flux.state().flux_v_s.beta, 0.0, 1e-5);

  const auto before = flux.state().flux_v_s;
  flux.set_frequency(3.0F);  // what e / (j w_e) would be is noise there
  flux.seed();
  EXPECT_EQ(flux.state().flux_v_s.alpha, before.alpha);
}

// The gain for an offset, 2 c/(1 - a): about (1/lambda) times that of the fundamental.
TEST(FluxTorque, BoundsWhatAnOffsetLeaves) {
  auto flux = FluxTorque::make(config_at(5000.0)).value();
  flux.set_frequency(100.0F);
  for (int k = 0; k < 20000; ++k) flux.step({.voltage_v = {1.0F, 0.0F}, .current_a = {}}, 1.0F);
  const double size = std::hypot(static_cast<double>(flux.state().flux_v_s.alpha),
                                 static_cast<double>(flux.state().flux_v_s.beta));
  EXPECT_NEAR(size, std::hypot(1.0 / 0.2, 1.0) / 100.0, 0.01 * size);
}

TEST(FluxTorque, RemoveOffsetTakesOutExactlyWhatTheOffsetLeft) {
  const Steady motor{.frequency_rad_s = 94.2};
  const Complex offset_v{2.1, -1.3};
  const Complex offset_a{0.08, 0.05};
  auto clean = FluxTorque::make(config_at(5000.0)).value();
  auto biased = FluxTorque::make(config_at(5000.0)).value();
  clean.set_frequency(94.2F);
  biased.set_frequency(94.2F);
  for (int k = 0; k < 10000; ++k) {
    clean.step(motor.at(k * 2e-4), 1.0F);
    biased.step(motor.at(k * 2e-4, offset_v, offset_a), 1.0F);
  }
  EXPECT_GT(std::abs(biased.state().torque_nm - clean.state().torque_nm), 0.01);
  biased.remove_offset(vector_of(offset_v), vector_of(offset_a));
  EXPECT_NEAR(biased.state().flux_v_s.alpha, clean.state().flux_v_s.alpha, 2e-5);
  EXPECT_NEAR(biased.state().flux_v_s.beta, clean.state().flux_v_s.beta, 2e-5);
  for (int k = 10000; k < 10010; ++k) {
    clean.step(motor.at(k * 2e-4), 1.0F);
    biased.step(motor.at(k * 2e-4), 1.0F);
    EXPECT_NEAR(biased.state().torque_nm, clean.state().torque_nm, 1e-3);
  }
}

// (E65), checked against what it is for: shaft speeds integrated sample by sample.
TEST(FluxTorque, FirstMomentGivesTheMeanSpeedOfTheWindow) {
  constexpr double kInertia = 0.03;
  constexpr double kLoad = 4.0;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (const int n : {1, 2, 5, 20}) {
    const double rate_hz = 1000.0 * n;
    auto flux = FluxTorque::make(config_at(rate_hz)).value();
    flux.set_frequency(314.159F);
    Steady motor{.frequency_rad_s = 314.159};
    double speed = 150.0;
    double before = 0.0;
    int at = 0;
    for (int window = 0; window < 200; ++window) {
      double mean_speed = 0.0;
      for (int k = 0; k < n; ++k) {
        motor.current_a = Complex(3.0, 5.0 + normal(random));
        flux.step(motor.at(at++ / rate_hz), 1.0F);
        const double torque = static_cast<double>(flux.state().torque_nm);
        speed += (0.5 * (torque + before) - kLoad) / (rate_hz * kInertia);
        before = torque;
        mean_speed += speed / n;
      }
      const auto w = flux.take();
      const double g = static_cast<double>(w.duration_s) / kInertia;
      const double centre = (n - 1.0) / (2.0 * n);
      EXPECT_NEAR(mean_speed, speed - g * (static_cast<double>(w.moment_nm) - centre * kLoad), 2e-5)
          << n << ' ' << window;
    }
  }
}

TEST(FluxTorque, MeansOfTheWindowAreThoseOfItsSamples) {
  const Steady motor{.frequency_rad_s = 314.159};
  auto flux = FluxTorque::make(config_at(5000.0)).value();
  flux.set_frequency(314.159F);
  for (int k = 0; k < 3000; ++k) flux.step(motor.at(k * 2e-4), 1.0F);
  static_cast<void>(flux.take());
  for (int k = 3000; k < 3005; ++k) flux.step(motor.at(k * 2e-4), 1.0F);
  const auto w = flux.take();
  EXPECT_NEAR(w.duration_s, 1e-3, 1e-9);
  EXPECT_NEAR(w.current_squared_a2, std::norm(motor.current_a), 1e-3);
  const double power = motor.torque_nm() * motor.frequency_rad_s / kPolePairs +
                       1.5 * kResistance * std::norm(motor.current_a);
  EXPECT_NEAR(w.power_w, power, 1e-4 * power);

  const auto empty = flux.take();
  EXPECT_EQ(empty.duration_s, 0.0F);
  EXPECT_EQ(empty.torque_nm, flux.state().torque_nm);
}

TEST(FluxTorque, RefusesWhatItCannotWorkWith) {
  using Error = FluxTorque::ConfigError;
  const auto refused = [](auto change) {
    auto config = config_at(5000.0);
    change(config);
    const auto made = FluxTorque::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.sample_period_s = 0.0F; }), Error::kPeriod);
  EXPECT_EQ(refused([](auto& c) { c.sample_period_s = NAN; }), Error::kPeriod);
  EXPECT_EQ(refused([](auto& c) { c.pole_pairs = 0.0F; }), Error::kPolePairs);
  EXPECT_EQ(refused([](auto& c) { c.pole_pairs = NAN; }), Error::kPolePairs);
  EXPECT_EQ(refused([](auto& c) { c.stator_resistance_ohm = -0.1F; }), Error::kResistance);
  EXPECT_EQ(refused([](auto& c) { c.leak_ratio = 0.0F; }), Error::kLeak);
  EXPECT_EQ(refused([](auto& c) { c.leak_ratio = 1.0F; }), Error::kLeak);
  EXPECT_EQ(refused([](auto&) {}), std::nullopt);
}

// Whatever frequency it is told, even far beyond the sample rate, the integral stays bounded.
TEST(FluxTorque, StaysBoundedUnderRandomSignalsAndFrequencies) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> draw(-1.0F, 1.0F);
  auto flux = FluxTorque::make(config_at(1000.0)).value();
  for (int k = 0; k < 200'000; ++k) {
    if (k % 10 == 0) flux.set_frequency(3000.0F * draw(random));
    const float elapsed = k % 7 == 0 ? 1.0F + 20.0F * std::abs(draw(random)) : 1.0F;
    flux.step({.voltage_v = {600.0F * draw(random), 600.0F * draw(random)},
               .current_a = {50.0F * draw(random), 50.0F * draw(random)}},
              elapsed);
    ASSERT_LT(std::abs(flux.state().flux_v_s.alpha), 1e3F) << k;
    ASSERT_LT(std::abs(flux.state().flux_v_s.beta), 1e3F) << k;
    if (k % 5 == 4) {
      ASSERT_TRUE(std::isfinite(flux.take().torque_nm)) << k;
    }
  }
}

TEST(FluxTorque, GivesTheSameInRunsAsSampleBySample) {
  std::mt19937 random(17);
  std::uniform_real_distribution<float> draw(-1.0F, 1.0F);
  auto singly = FluxTorque::make(config_at(5000.0)).value();
  auto in_runs = singly;
  for (int run = 0; run < 5000; ++run) {
    std::vector<MotorSample> samples(random() % 9);
    for (MotorSample& sample : samples) {
      sample = {.voltage_v = {600.0F * draw(random), 600.0F * draw(random)},
                .current_a = {50.0F * draw(random), 50.0F * draw(random)}};
      singly.step(sample, 1.0F);
    }
    in_runs.step_run(samples);
    ASSERT_TRUE(same_bits(singly.state(), in_runs.state())) << run;
    if (run % 3 != 0) continue;
    ASSERT_TRUE(same_bits(singly.take(), in_runs.take())) << run;
    const float frequency_rad_s = 600.0F * draw(random);
    singly.set_frequency(frequency_rad_s);
    in_runs.set_frequency(frequency_rad_s);
  }
}

TEST(FluxTorque, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  const Steady motor{.frequency_rad_s = 314.159};
  auto original = FluxTorque::make(config_at(5000.0)).value();
  auto resumed = original;
  const auto allocations = allocation_count();
  for (int k = 0; k < 1000; ++k) {
    resumed.restore(original.state());
    const auto sample = motor.at(k * 2e-4);
    original.step(sample, 1.0F);
    resumed.step(sample, 1.0F);
    if (k % 5 == 4) {
      const auto a = original.take();
      const auto b = resumed.take();
      ASSERT_TRUE(same_bits(a, b)) << k;
      original.set_frequency(200.0F + static_cast<float>(k));
      resumed.set_frequency(200.0F + static_cast<float>(k));
    }
    ASSERT_TRUE(same_bits(original.state(), resumed.state())) << k;
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
