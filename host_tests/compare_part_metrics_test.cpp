// The figures of merit of one part, against forces whose integrals are known.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "firmware/host/compare/comparison.hpp"
#include "firmware/host/compare/part_metrics.hpp"

namespace cutforce::firmware::host {
namespace {

constexpr double kStep_s = 0.002;

PartScore::Config config(double mean_s = 0.0) {
  return {.reference_n = 500.0,
          .ceiling_pct = 200.0,
          .step_s = kStep_s,
          .mean_s = mean_s,
          .settle_from_m = 0.010,
          .settle_to_m = 0.020};
}

// 10 s at 2 mm/s, so that the watched stretch lasts from 5 s to 10 s.
template <class Force>
PartMetrics score(Force force_n, double override_pct = 100.0, bool in_cut = true,
                  double mean_s = 0.0) {
  PartScore score(config(mean_s));
  for (int k = 1; k <= 5000; ++k) {
    const double t = kStep_s * k;
    score.step({.time_s = t,
                .force_n = force_n(t),
                .position_m = 0.002 * t,
                .override_pct = override_pct,
                .in_cut = in_cut});
  }
  return score.metrics(true);
}

TEST(PartMetrics, OfAConstantExcessAreItsProducts) {
  const PartMetrics m = score([](double) { return 600.0; });
  EXPECT_NEAR(m.impulse_ns, 1000.0, 1e-6);
  EXPECT_NEAR(m.impulse_105_ns, 750.0, 1e-6);
  EXPECT_NEAR(m.above_110_s, 10.0, 1e-9);
  EXPECT_NEAR(m.rms_ratio, 0.2, 1e-12);
  EXPECT_NEAR(m.mean_ratio, 1.2, 1e-12);
  EXPECT_EQ(m.peak_ratio, 1.2);
  EXPECT_EQ(m.shortfall_ns, 0.0);
  EXPECT_NEAR(m.time_s, 10.0, 1e-9);
}

TEST(PartMetrics, ChargeAShortfallInTheCutBelowTheCeilingOnly) {
  const auto low = [](double) { return 300.0; };
  EXPECT_NEAR(score(low).shortfall_ns, 2000.0, 1e-6);
  EXPECT_EQ(score(low, 200.0).shortfall_ns, 0.0);
  EXPECT_EQ(score(low, 100.0, false).shortfall_ns, 0.0);
  EXPECT_EQ(score(low, 200.0).rms_ratio, 0.0);
}

TEST(PartMetrics, OfASineFollowItsIntegral) {
  constexpr double kAmplitude_n = 100.0;
  const PartMetrics m =
      score([](double t) { return 500.0 + kAmplitude_n * std::sin(2.0 * std::numbers::pi * t); });
  EXPECT_NEAR(m.impulse_ns, 10.0 * kAmplitude_n / std::numbers::pi, 0.05);
  EXPECT_NEAR(m.shortfall_ns, m.impulse_ns, 0.05);
  EXPECT_NEAR(m.rms_ratio, 0.2 / std::numbers::sqrt2, 1e-4);
  // Above 525 N: 2 (A cos(asin(1/4)) - 25 (pi/2 - asin(1/4))) / (2 pi) a second.
  const double angle = std::asin(0.25);
  const double above =
      (kAmplitude_n * std::cos(angle) - 25.0 * (0.5 * std::numbers::pi - angle)) / std::numbers::pi;
  EXPECT_NEAR(m.impulse_105_ns, 10.0 * above, 0.05);
}

// 1.5 exp(-t/0.4): within 5 % after 0.4 ln 10 s.
TEST(PartMetrics, SettlingIsTheLastTimeOutsideTheBand) {
  const PartMetrics m =
      score([](double t) { return t < 5.0 ? 500.0 : 500.0 + 250.0 * std::exp(-(t - 5.0) / 0.4); });
  EXPECT_NEAR(m.settling_s, 0.4 * std::log(10.0), 2.0 * kStep_s);
  EXPECT_EQ(score([](double) { return 510.0; }).settling_s, 0.0);
}

TEST(PartMetrics, AnInterruptedForceIsJudgedByItsMean) {
  // 15 % of each 60 ms without force, and 500 N in the mean.
  const auto gaps = [](double t) { return std::fmod(t, 0.06) < 0.009 ? 0.0 : 500.0 / 0.85; };
  EXPECT_GT(score(gaps).impulse_ns, 500.0);
  EXPECT_LT(score(gaps, 100.0, true, 0.06).impulse_ns, 150.0);
  EXPECT_LT(score(gaps, 100.0, true, 0.06).peak_ratio, 1.04);
}

TEST(PartMetrics, CountChangesNotSendings) {
  PartScore score(config());
  for (const double pct : {100.0, 100.0, 101.0, 101.0, 100.0}) score.sent(pct);
  EXPECT_EQ(score.metrics(true).changes, 2.0);
}

TEST(PartMetrics, MeansOverSeedsKeepTheWorstPeak) {
  const PartMetrics a{.peak_ratio = 1.5,
                      .impulse_105_ns = 10.0,
                      .settling_s = 0.2,
                      .time_s = 4.0,
                      .finished = true};
  const PartMetrics b{.peak_ratio = 1.1,
                      .impulse_105_ns = 20.0,
                      .settling_s = 0.4,
                      .time_s = 6.0,
                      .finished = false};
  const PartMetrics m = mean({a, b});
  EXPECT_EQ(m.peak_ratio, 1.5);
  EXPECT_NEAR(m.impulse_105_ns, 15.0, 1e-12);
  EXPECT_NEAR(m.settling_s, 0.3, 1e-12);
  EXPECT_NEAR(m.time_s, 5.0, 1e-12);
  EXPECT_FALSE(m.finished);
}

}  // namespace
}  // namespace cutforce::firmware::host
