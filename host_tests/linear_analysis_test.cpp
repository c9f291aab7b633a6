#include "firmware/host/design/linear_analysis.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <random>
#include <vector>

#include "support/cutting_plant.hpp"

namespace cutforce::firmware::host {
namespace {

// P2 (26), force [N] over feed [mm/s], and its sampling time.
const ContinuousPlant kEndMill = second_order(6037.7, 160.2, 438.8);
constexpr double kPeriod_s = 0.02;

void expect_near(const Polynomial& found, const Polynomial& wanted, double tolerance) {
  ASSERT_EQ(found.size(), wanted.size());
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], wanted[i], tolerance) << i;
}

TEST(Discretise, GivesTheSampledEndMillOfThePaper) {
  const auto plant = discretise(kEndMill, kPeriod_s, 0.0);
  expect_near(plant.denominator, {1.0, -0.988701, 0.0405995}, 1e-6);
  expect_near(plant.numerator, {0.522168, 0.191929}, 1e-6);
  EXPECT_NEAR(static_gain(plant), 13.7596, 1e-4);
}

// P2 (18) with C = b / sqrt(a1^2 - 4 a0), for plants with two real poles apart.
TEST(Discretise, AgreesWithThePartialFractionsOfSecondOrderPlants) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> rate(0.5, 200.0);
  for (int i = 0; i < 300; ++i) {
    const double a = rate(random);
    const double b = a + rate(random);
    const double gain = rate(random);
    const double c = gain / (b - a);
    const double ea = std::exp(-a * kPeriod_s);
    const double eb = std::exp(-b * kPeriod_s);
    const auto plant = discretise(second_order(gain, a + b, a * b), kPeriod_s, 0.0);
    expect_near(plant.denominator, {1.0, -(ea + eb), ea * eb}, 1e-11);
    expect_near(plant.numerator,
                {c / a * (1.0 - ea) - c / b * (1.0 - eb),
                 -c / a * (1.0 - ea) * eb + c / b * (1.0 - eb) * ea},
                1e-11 * (1.0 + gain));
  }
}

// (C15): alpha z^-1 and so on, with whole periods of latency.
TEST(Discretise, GivesTheTurningPlantOfTheClosedLoopTests) {
  const double alpha = std::exp(-0.5);
  const auto plant = discretise(lags(4.0, {0.1}), 0.05, 0.05);
  expect_near(plant.numerator, {4.0 * (1.0 - alpha)}, 1e-12);
  expect_near(plant.denominator, {1.0, -alpha, 0.0}, 1e-12);
  // A cut that settles within the tick has no pole but the latency's.
  const auto at_once = discretise(lags(4.0, {0.0}), 0.1, 0.0);
  expect_near(at_once.numerator, {4.0}, 1e-12);
  expect_near(at_once.denominator, {1.0, 0.0}, 1e-12);
}

// The output of the sampled plant against small Euler steps of the continuous one, with a delay
// that is not a whole number of periods; equal and complex poles included.
TEST(Discretise, FollowsTheContinuousPlantThroughAnyDelay) {
  const std::vector<std::pair<ContinuousPlant, double>> cases = {
      {lags(4.0, {0.1, 0.03, 0.03}), 0.035},
      {lags(4.0, {0.1}), 0.012},
      {second_order(50.0, 4.0, 100.0), 0.0},
      {second_order(50.0, 20.0, 100.0), 0.071},
      {lags(2.0, {0.1, 0.1, 0.1}), 0.05}};
  for (const auto& [continuous, delay_s] : cases) {
    const double period_s = 0.05;
    const auto plant = discretise(continuous, period_s, delay_s);
    // Step response at tick n: the sum of the impulse response.
    std::vector<double> force;
    const std::size_t order = plant.denominator.size() - 1;
    for (std::size_t n = 0; n < 40; ++n) {
      double now = 0.0;
      for (std::size_t k = 0; k < plant.numerator.size(); ++k) {
        const std::size_t lag = order + 1 - plant.numerator.size() + k;
        if (n >= lag) now += plant.numerator[k];
      }
      for (std::size_t k = 1; k <= order && k <= n; ++k) now -= plant.denominator[k] * force[n - k];
      force.push_back(now);
    }
    // Companion form in steps of 1 us.
    const std::size_t states = continuous.denominator.size() - 1;
    std::vector<double> x(states, 0.0);
    constexpr double kStep_s = 1e-6;
    const auto steps = std::llround(period_s / kStep_s);
    const auto delay = std::llround(delay_s / kStep_s);
    const double leading = continuous.denominator[0];
    for (long long i = 0; i < 20 * steps; ++i) {
      if (i % steps == 0) {
        EXPECT_NEAR(continuous.numerator[0] / leading * x[states - 1],
                    force[static_cast<std::size_t>(i / steps)], 2e-4);
      }
      double rate = i >= delay ? 1.0 : 0.0;
      for (std::size_t k = 0; k < states; ++k)
        rate -= continuous.denominator[k + 1] / leading * x[k];
      for (std::size_t k = states - 1; k > 0; --k) x[k] += kStep_s * x[k - 1];
      x[0] += kStep_s * rate;
    }
  }
}

TEST(Roots, AreThoseThePolynomialWasMadeOf) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> coordinate(-2.0, 2.0);
  for (int i = 0; i < 500; ++i) {
    Polynomial polynomial{3.0};
    std::vector<std::complex<double>> wanted;
    for (int k = 0; k < 3; ++k) {
      const std::complex<double> root(coordinate(random), coordinate(random));
      const double real = coordinate(random);
      polynomial = product(polynomial, {1.0, -2.0 * root.real(), std::norm(root)});
      polynomial = product(polynomial, {1.0, -real});
      wanted.insert(wanted.end(), {root, std::conj(root), real});
    }
    double radius = 0.0;
    for (const auto& root : wanted) radius = std::max(radius, std::abs(root));
    EXPECT_NEAR(spectral_radius(polynomial), radius, 1e-6) << i;
    for (const auto& found : roots(polynomial)) {
      double nearest = std::numeric_limits<double>::infinity();
      for (const auto& root : wanted) nearest = std::min(nearest, std::abs(found - root));
      EXPECT_LT(nearest, 1e-6) << i;
    }
    if (std::abs(radius - 1.0) > 1e-9) {
      EXPECT_EQ(is_stable(polynomial), radius < 1.0) << i;
    }
    // Reversed, every root is outside that was inside.
    std::ranges::reverse(polynomial);
    double smallest = std::numeric_limits<double>::infinity();
    for (const auto& root : wanted) smallest = std::min(smallest, std::abs(root));
    EXPECT_NEAR(spectral_radius(polynomial) * smallest, 1.0, 1e-5) << i;
  }
}

TEST(Roots, TakeThoseAtZeroAndEqualOnesToo) {
  EXPECT_NEAR(spectral_radius({1.0, -0.5, 0.0, 0.0, 0.0}), 0.5, 1e-12);
  EXPECT_EQ(spectral_radius({1.0, 0.0, 0.0}), 0.0);
  EXPECT_EQ(spectral_radius({7.0}), 0.0);
  EXPECT_TRUE(is_stable({7.0}));
  EXPECT_NEAR(spectral_radius(product({1.0, -0.9}, {1.0, -0.9})), 0.9, 1e-6);
  EXPECT_FALSE(is_stable({1.0, -1.0}));  // on the circle
  EXPECT_FALSE(is_stable({0.0, 1.0}));   // of lower degree than it says
}

TEST(Ultimate, IsThePapersPlantsOwnAtItsOwnSamplingTime) {
  const auto plant = discretise(kEndMill, kPeriod_s, 0.0);
  const auto found = ultimate(plant);
  EXPECT_NEAR(found.gain, 4.999, 1e-3);
  EXPECT_NEAR(found.period_s, 0.0499, 1e-4);
  const auto delayed = ultimate(discretise(kEndMill, kPeriod_s, kPeriod_s));
  EXPECT_NEAR(delayed.gain, 1.265, 1e-3);
  EXPECT_NEAR(delayed.period_s, 0.1385, 1e-4);
  // The printed pair, 52.94 and 0.02398 s, is of no such plant; a 1 ms step comes closest.
  const auto fast = ultimate(discretise(kEndMill, 1e-3, 0.0));
  EXPECT_NEAR(fast.gain, 54.5, 0.1);
  EXPECT_NEAR(fast.period_s, 0.0112, 1e-4);
}

TEST(Ultimate, IsThatOfTheTurningPlant) {
  const auto found = ultimate(discretise(lags(1.0, {0.1}), 0.05, 0.05));
  EXPECT_NEAR(found.gain, 1.0 / (1.0 - std::exp(-0.5)), 1e-9);
  EXPECT_NEAR(found.period_s, 0.249, 1e-3);
  // One lag alone alternates at the end of the frequency range; its sampled gain is 1 - alpha.
  const auto alone = ultimate(discretise(lags(1.0, {0.1}), 0.05, 0.0));
  EXPECT_NEAR(alone.gain, (1.0 + std::exp(-0.5)) / (1.0 - std::exp(-0.5)), 1e-9);
  EXPECT_NEAR(alone.period_s, 0.1, 1e-9);
}

// Whatever the plant: just below the ultimate gain the loop settles, just above it does not.
TEST(Ultimate, SeparatesStableFromUnstableGains) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> lag_s(0.005, 0.3);
  std::uniform_real_distribution<double> delay_s(0.0, 0.25);
  for (int i = 0; i < 100; ++i) {
    const auto plant =
        discretise(lags(4.0, {lag_s(random), lag_s(random), lag_s(random)}), 0.05, delay_s(random));
    const double gain = ultimate(plant).gain;
    EXPECT_TRUE(is_stable(closed_loop(plant, proportional(0.999 * gain)))) << i;
    EXPECT_FALSE(is_stable(closed_loop(plant, proportional(1.001 * gain)))) << i;
    EXPECT_LT(spectral_radius(closed_loop(plant, proportional(0.999 * gain))), 1.0) << i;
    EXPECT_NEAR(spectral_radius(closed_loop(plant, proportional(gain))), 1.0, 1e-5) << i;
  }
}

// An integrator on one whole period of delay: L = g / (z (z - 1)) in closed form. |L| = 1 where
// 2 sin(w/2) = g, the phase there is pi/2 - 3w/2, and 1/g is the gain margin (C13 without K_p).
TEST(Margins, AreThoseOfAnIntegratorBehindOnePeriodInClosedForm) {
  const DiscretePlant plant = discretise(lags(1.0, {}), 0.05, 0.05);
  for (const double gain : {0.05, 0.3, 0.7, 0.95}) {
    const auto found = margins(plant, {{gain, 0.0}, {1.0, -1.0}});
    const double angle = 2.0 * std::asin(gain / 2.0);
    EXPECT_TRUE(found.stable);
    EXPECT_NEAR(found.gain_ratio, 1.0 / gain, 1e-9);
    EXPECT_NEAR(found.phase_rad, std::acos(-1.0) / 2.0 - 1.5 * angle, 1e-9);
    EXPECT_NEAR(found.delay_s, found.phase_rad / angle * 0.05, 1e-9);
    EXPECT_NEAR(found.peak_sensitivity * found.modulus_ratio, 1.0, 1e-12);
  }
}

TEST(Margins, AreWhatTheLoopReallyBears) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> proportional_pct_n(0.0F, 0.8F);
  std::uniform_real_distribution<float> integral_pct_n_s(0.1F, 6.0F);
  std::uniform_real_distribution<double> lag_s(0.01, 0.2);
  int stable = 0;
  for (int i = 0; i < 300; ++i) {
    const auto law = controller_of({.period_s = 0.05F,
                                    .form = control::PiController::Form::kVelocity,
                                    .proportional_pct_n = proportional_pct_n(random),
                                    .integral_pct_n_s = integral_pct_n_s(random),
                                    .tracking_s = 0.05F,
                                    .supervise = false});
    const auto plant = discretise(lags(4.0, {lag_s(random), lag_s(random)}), 0.05, 0.05);
    const auto found = margins(plant, law);
    EXPECT_EQ(found.stable, spectral_radius(closed_loop(plant, law)) < 1.0) << i;
    if (!found.stable) {
      EXPECT_EQ(found.gain_ratio, 0.0);
      EXPECT_EQ(found.modulus_ratio, 0.0);
      continue;
    }
    ++stable;
    const auto at_gain = [&](double ratio) {
      auto changed = plant;
      for (double& coefficient : changed.numerator) coefficient *= ratio;
      return is_stable(closed_loop(changed, law));
    };
    EXPECT_TRUE(at_gain(1.0 + 0.999 * (found.gain_ratio - 1.0))) << i;
    EXPECT_FALSE(at_gain(1.001 * found.gain_ratio)) << i;
    // Known relations: gain margin >= Ms/(Ms-1), phase margin >= 2 asin(1/(2 Ms)).
    EXPECT_LE(found.modulus_ratio, 1.0 - 1.0 / found.gain_ratio + 1e-9) << i;
    EXPECT_GE(found.phase_rad, 2.0 * std::asin(found.modulus_ratio / 2.0) - 1e-9) << i;
    // The distance of every other point of the curve is no smaller.
    for (int k = 1; k <= 200; ++k) {
      const auto z = std::polar(1.0, std::acos(-1.0) * k / 200.5);
      const auto open = value(plant.numerator, z) / value(plant.denominator, z) *
                        value(law.numerator, z) / value(law.denominator, z);
      EXPECT_GE(std::abs(1.0 + open), found.modulus_ratio - 1e-9);
    }
  }
  EXPECT_GT(stable, 50);
  EXPECT_LT(stable, 290);
}

// (C16) against the loop that runs: the reproduction plant at 0.286 / 1.38 is stable up to 7.43.
TEST(Margins, GiveTheProcessGainAtWhichTheReproductionLoopIsLost) {
  const auto law = controller_of({.period_s = 0.05F,
                                  .form = control::PiController::Form::kVelocity,
                                  .proportional_pct_n = 0.286F,
                                  .integral_pct_n_s = 1.38F,
                                  .tracking_s = 0.05F,
                                  .supervise = false});
  const auto found = margins(discretise(lags(4.0, {0.1}), 0.05, 0.05), law);
  EXPECT_NEAR(4.0 * found.gain_ratio, 7.43, 0.01);
}

}  // namespace
}  // namespace cutforce::firmware::host
