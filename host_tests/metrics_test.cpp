// The figures of merit, on truths and estimates whose answers can be written down.
#include "firmware/host/evaluation/metrics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>

namespace cutforce::firmware::host {
namespace {

constexpr double kRated_nm = 20.0;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kTwoPi = 2.0 * std::numbers::pi;

TruthSeries truth_of(const std::function<double(double)>& torque_nm, double length_s,
                     double rate_hz = 5000.0) {
  TruthSeries truth{.time_s = {}, .torque_nm = {}, .rated_torque_nm = kRated_nm};
  const int count = static_cast<int>(length_s * rate_hz);
  for (int k = 0; k <= count; ++k) {
    truth.time_s.push_back(k / rate_hz);
    truth.torque_nm.push_back(torque_nm(k / rate_hz));
  }
  return truth;
}

EstimateSeries estimate_of(const std::function<double(double)>& torque_nm, double length_s,
                           double sigma_nm, double rate_hz = 1000.0) {
  EstimateSeries estimate;
  const int count = static_cast<int>(length_s * rate_hz);
  for (int k = 0; k <= count; ++k) {
    estimate.time_s.push_back(k / rate_hz);
    estimate.torque_nm.push_back(torque_nm(k / rate_hz));
    estimate.sigma_nm.push_back(sigma_nm);
  }
  return estimate;
}

double edge(double t, double from_s, double length_s) {
  return std::clamp((t - from_s) / length_s, 0.0, 1.0);
}

// Idle, 40 % at 2 s, 60 % at 3 s, idle again at 4 s, each over 30 ms.
double entry_and_exit_nm(double t) {
  return 8.0 * edge(t, 2.0, 0.03) + 4.0 * edge(t, 3.0, 0.03) - 12.0 * edge(t, 4.0, 0.03);
}

Metrics score(const TruthSeries& truth, const EstimateSeries& estimate) {
  return host::score(truth, find_load_profile(truth), estimate);
}

TEST(LoadProfile, FindsThePlateausAndStepsOfAnEntryAndAnExit) {
  const auto profile = find_load_profile(truth_of(entry_and_exit_nm, 4.6));
  ASSERT_EQ(profile.plateaus.size(), 4U);
  ASSERT_EQ(profile.steps.size(), 3U);
  EXPECT_TRUE(profile.ramps.empty());
  EXPECT_TRUE(profile.tones.empty());
  EXPECT_NEAR(profile.scored_from_s, 2.0, 2e-3);
  EXPECT_NEAR(profile.steps[0].from_s, 2.0, 2e-3);
  EXPECT_NEAR(profile.steps[0].to_s, 2.03, 2e-3);
  EXPECT_NEAR(profile.steps[0].until_s, 3.0, 2e-3);
  EXPECT_NEAR(profile.steps[2].before_nm, 12.0, 0.05);
  EXPECT_NEAR(profile.steps[2].after_nm, 0.0, 0.05);
}

TEST(LoadProfile, TellsAStepARampAndADriftApart) {
  const auto truth = truth_of(
      [](double t) {
        return 4.0 * edge(t, 1.0, 0.2) + 8.0 * edge(t, 2.0, 1.0) + 0.2 * edge(t, 4.0, 2.0);
      },
      6.5);
  const auto profile = find_load_profile(truth);
  ASSERT_EQ(profile.steps.size(), 1U);
  ASSERT_EQ(profile.ramps.size(), 1U);
  EXPECT_NEAR(profile.ramps[0].from_s, 2.0, 0.01);
  EXPECT_NEAR(profile.ramps[0].to_s, 3.0, 0.01);
  EXPECT_EQ(profile.plateaus.size(), 3U);  // 1 % in 2 s is a plateau that drifts
}

TEST(LoadProfile, TakesARampUpAndDownWithoutAStopForTwoRamps) {
  const auto profile = find_load_profile(
      truth_of([](double t) { return 12.0 * (edge(t, 1.0, 0.8) - edge(t, 1.8, 0.8)); }, 3.5));
  ASSERT_EQ(profile.ramps.size(), 2U);
  EXPECT_NEAR(profile.ramps[0].after_nm, 12.0, 0.1);
  EXPECT_NEAR(profile.ramps[1].to_s, 2.6, 0.01);
}

TEST(LoadProfile, FindsTheEntryOfAFirstOrderProcessAsAStep) {
  const auto profile = find_load_profile(truth_of(
      [](double t) { return t < 1.0 ? 0.0 : 8.0 * (1.0 - std::exp((1.0 - t) / 0.1)); }, 3.0));
  ASSERT_EQ(profile.steps.size(), 1U);
  // The plateau begins where a window of 0.1 s moves by 0.2 %: rest (1 - 1/e) = 0.04 N m.
  EXPECT_NEAR(profile.steps[0].after_nm, 8.0 - 0.04 / (1.0 - std::exp(-1.0)), 0.002);
}

TEST(LoadProfile, FindsBothTonesOfALoadThatOscillatesTwice) {
  const auto profile = find_load_profile(truth_of(
      [](double t) {
        const double on = t > 1.0 && t < 3.0 ? 1.0 : 0.0;
        return on * (8.0 + 2.0 * std::sin(kTwoPi * 15.0 * t) + std::cos(kTwoPi * 121.3 * t));
      },
      4.0));
  ASSERT_EQ(profile.tones.size(), 2U);
  EXPECT_NEAR(profile.tones[0].frequency_hz, 15.0, 0.01);
  EXPECT_NEAR(profile.tones[0].amplitude_nm, 2.0, 0.01);
  EXPECT_NEAR(profile.tones[1].frequency_hz, 121.3, 0.02);
  EXPECT_TRUE(profile.steps.empty());
}

TEST(LoadProfile, CountsAnInterruptedCutAsOneToneWithoutItsHarmonics) {
  const auto profile = find_load_profile(truth_of(
      [](double t) {
        if (t < 1.0 || t > 3.0) return 0.0;
        return std::sin(kTwoPi * 15.0 * t) > 0.0 ? 8.0 : 0.0;
      },
      4.0));
  ASSERT_EQ(profile.tones.size(), 1U);
  EXPECT_NEAR(profile.tones[0].frequency_hz, 15.0, 0.05);
}

TEST(LoadProfile, SurvivesTruthsWithNothingInThem) {
  EXPECT_TRUE(
      find_load_profile({.time_s = {}, .torque_nm = {}, .rated_torque_nm = 1.0}).plateaus.empty());
  EXPECT_TRUE(find_load_profile({.time_s = {0.0}, .torque_nm = {1.0}, .rated_torque_nm = 1.0})
                  .plateaus.empty());
  const auto idle = find_load_profile(truth_of([](double) { return 0.0; }, 2.0));
  ASSERT_EQ(idle.plateaus.size(), 1U);
  EXPECT_TRUE(idle.steps.empty());
  EXPECT_NEAR(idle.scored_from_s, 1.0, 1e-3);  // never in the cut: the second half is scored
}

TEST(Metrics, GiveAPerfectEstimateFullMarks) {
  const auto truth = truth_of(entry_and_exit_nm, 4.6);
  const auto m = score(truth, estimate_of(entry_and_exit_nm, 4.6, 0.1));
  EXPECT_NEAR(*m.steady_error_pct, 0.0, 1e-9);
  EXPECT_NEAR(*m.noise_pct, 0.0, 1e-9);
  EXPECT_NEAR(*m.t50_ms, 0.0, 0.05);
  EXPECT_NEAR(*m.t90_ms, 0.0, 0.05);
  EXPECT_NEAR(*m.overshoot_pct, 0.0, 1e-9);
  EXPECT_NEAR(*m.coverage_pct, 100.0, 1e-9);
  EXPECT_NEAR(*m.mean_sigma_pct, 0.5, 1e-9);
  EXPECT_NEAR(m.availability_pct, 100.0, 0.1);
}

TEST(Metrics, MeasureADelayToAHundredthOfAMillisecond) {
  const auto truth = truth_of(entry_and_exit_nm, 4.6);
  for (const double delay_s : {-0.0025, 0.0005, 0.0033, 0.0222}) {
    SCOPED_TRACE(delay_s);
    const auto m = score(
        truth, estimate_of([&](double t) { return entry_and_exit_nm(t - delay_s); }, 4.6, 0.1));
    EXPECT_NEAR(*m.t50_ms, 1e3 * delay_s, 0.05);
    EXPECT_NEAR(*m.t90_ms, 1e3 * delay_s, 0.05);
    EXPECT_NEAR(*m.least_t50_ms, 1e3 * delay_s, 0.05);
  }
}

// A first-order lag behind a sudden step of 40 %: t50 = tau ln 2, t90 = tau ln 10.
TEST(Metrics, MeasureTheLagOfAFirstOrderFilter) {
  const auto truth = truth_of([](double t) { return 8.0 * edge(t, 2.0, 1e-3); }, 4.0);
  constexpr double kTau_s = 0.05;
  const auto m = score(
      truth,
      estimate_of(
          [](double t) { return t < 2.0005 ? 0.0 : 8.0 * (1.0 - std::exp((2.0005 - t) / kTau_s)); },
          4.0, 0.1));
  EXPECT_NEAR(*m.t50_ms, 1e3 * kTau_s * std::log(2.0), 0.1);
  EXPECT_NEAR(*m.t90_ms, 1e3 * kTau_s * std::log(10.0) - 0.4, 0.1);  // the edge itself takes 1 ms
  EXPECT_LT(*m.overshoot_pct, 1e-6);
}

TEST(Metrics, SplitBiasFromNoise) {
  const auto truth = truth_of(entry_and_exit_nm, 4.6);
  std::mt19937_64 random(1);
  std::normal_distribution<double> noise(0.0, 0.1);
  const auto m = score(
      truth,
      estimate_of([&](double t) { return entry_and_exit_nm(t) + 0.06 + noise(random); }, 4.6, 0.1));
  EXPECT_NEAR(*m.steady_error_pct, 0.3, 0.08);  // 0.1/20/sqrt(300 samples) = 0.03 %, worst of three
  EXPECT_NEAR(*m.noise_pct, 0.5, 0.06);
  EXPECT_NEAR(
      *m.coverage_pct,
      100.0 * 0.5 * (std::erf(1.4 / std::numbers::sqrt2) + std::erf(2.6 / std::numbers::sqrt2)),
      1.5);
}

TEST(Metrics, CountTheTwoSigmaCoverageOfHonestNoise) {
  const auto truth = truth_of(entry_and_exit_nm, 4.6);
  for (const double sigma_nm : {0.05, 0.1, 0.2}) {
    SCOPED_TRACE(sigma_nm);
    std::mt19937_64 random(2);
    std::normal_distribution<double> noise(0.0, 0.1);
    const auto m = score(
        truth,
        estimate_of([&](double t) { return entry_and_exit_nm(t) + noise(random); }, 4.6, sigma_nm));
    EXPECT_NEAR(*m.coverage_pct, 100.0 * std::erf(2.0 * sigma_nm / 0.1 / std::numbers::sqrt2), 1.5);
  }
}

TEST(Metrics, CountAScaleErrorBothAsSteadyErrorAndAsOvershoot) {
  const auto truth = truth_of(entry_and_exit_nm, 4.6);
  const auto m =
      score(truth, estimate_of([](double t) { return 1.02 * entry_and_exit_nm(t); }, 4.6, 0.1));
  EXPECT_NEAR(*m.steady_error_pct, 1.2, 1e-6);  // 2 % of 60 %
  EXPECT_NEAR(*m.overshoot_pct, 6.0, 1e-6);     // 1.2 % above the truth after a step of 20 %
}

TEST(Metrics, MeasureOvershootInPercentOfTheStep) {
  const auto truth = truth_of(entry_and_exit_nm, 4.6);
  const auto m = score(truth, estimate_of(
                                  [](double t) {
                                    const bool peak = t > 3.03 && t < 3.05;
                                    return entry_and_exit_nm(t) + (peak ? 0.4 : 0.0);
                                  },
                                  4.6, 0.1));
  EXPECT_NEAR(*m.overshoot_pct, 10.0, 0.01);
  EXPECT_NEAR(*m.steady_error_pct, 0.0, 1e-9);
}

TEST(Metrics, SayNeverWhereAnEstimateDoesNotReachTheStep) {
  const auto truth = truth_of(entry_and_exit_nm, 4.6);
  const auto m =
      score(truth, estimate_of([](double t) { return 0.8 * entry_and_exit_nm(t); }, 4.6, 0.1));
  ASSERT_EQ(m.steps.size(), 3U);
  EXPECT_LT(m.steps[0].t50_ms, 10.0);
  EXPECT_TRUE(std::isinf(*m.t90_ms));
}

TEST(Metrics, MeasureTheLagAndTheErrorOfARamp) {
  const auto ramp = [](double t) { return 8.0 * edge(t, 1.5, 1.0); };  // 40 %/s
  const auto truth = truth_of(ramp, 4.0);
  const auto m = score(truth, estimate_of([&](double t) { return ramp(t - 0.003); }, 4.0, 0.1));
  ASSERT_EQ(m.ramps.size(), 1U);
  EXPECT_NEAR(*m.ramp_lag_ms, 3.0, 0.01);
  EXPECT_NEAR(*m.ramp_error_pct, 0.12, 0.001);
  EXPECT_FALSE(m.t50_ms.has_value());
}

TEST(Metrics, MeasureTheGainAndDelayOfATone) {
  const auto load = [](double t) {
    return t < 1.0 ? 0.0 : 8.0 + 2.0 * std::sin(kTwoPi * 15.0 * t);
  };
  const auto truth = truth_of(load, 4.0);
  constexpr double kTau_s = 0.002;  // first-order lag: gain 1/sqrt(1+(w tau)^2), phase atan(w tau)
  const double w_tau = kTwoPi * 15.0 * kTau_s;
  const auto m = score(truth, estimate_of(
                                  [&](double t) {
                                    if (t < 1.0) return 0.0;
                                    return 8.0 + 2.0 / std::hypot(1.0, w_tau) *
                                                     std::sin(kTwoPi * 15.0 * t - std::atan(w_tau));
                                  },
                                  4.0, 0.1));
  ASSERT_EQ(m.tones.size(), 1U);
  EXPECT_NEAR(m.tones[0].gain_ratio, 1.0 / std::hypot(1.0, w_tau), 1e-3);
  EXPECT_NEAR(m.tones[0].phase_deg, std::atan(w_tau) * 180.0 / std::numbers::pi, 0.1);
  EXPECT_NEAR(m.tones[0].lag_ms, 1e3 * std::atan(w_tau) / (kTwoPi * 15.0), 0.02);
}

TEST(Metrics, CountRowsWithoutAnEstimateAndMissingRowsAsUnavailable) {
  const auto truth = truth_of(entry_and_exit_nm, 4.0);  // scored from 2 s: 2 s
  auto estimate = estimate_of(entry_and_exit_nm, 4.0, 0.1);
  for (std::size_t k = 2500; k < 3000; ++k) estimate.torque_nm[k] = kNan;
  estimate.time_s.erase(estimate.time_s.begin() + 3200, estimate.time_s.begin() + 3400);
  estimate.torque_nm.erase(estimate.torque_nm.begin() + 3200, estimate.torque_nm.begin() + 3400);
  estimate.sigma_nm.resize(estimate.time_s.size());
  const auto m = score(truth, estimate);
  EXPECT_NEAR(m.availability_pct, 100.0 * (2.0 - 0.5 - 0.2) / 2.0, 0.3);
  EXPECT_NEAR(*m.coverage_pct, 100.0, 1e-9);
}

TEST(Metrics, ClaimNothingWhereThereIsNoEstimate) {
  const auto truth = truth_of(entry_and_exit_nm, 4.6);
  const auto m = score(truth, estimate_of([](double) { return kNan; }, 4.6, kNan));
  EXPECT_FALSE(m.steady_error_pct || m.t50_ms || m.coverage_pct || m.first_estimate_s);
  EXPECT_EQ(m.availability_pct, 0.0);
  EXPECT_FALSE(score(truth, {}).t50_ms.has_value());
}

TEST(Metrics, ReadLoopOutputsAndLeaveOutWhatIsNotPresent) {
  std::array<LoopOutput, 2> rows{};
  rows[0].time_ns = 1'000'000;
  rows[1].time_ns = 2'000'000;
  rows[1].cutting_torque_nm = 3.5F;
  rows[1].cutting_torque_sigma_nm = 0.25F;
  rows[1].present = LoopOutput::kCuttingTorque;
  const auto estimate = to_estimate(rows);
  EXPECT_TRUE(std::isnan(estimate.torque_nm[0]));
  EXPECT_DOUBLE_EQ(estimate.time_s[1], 0.002);
  EXPECT_DOUBLE_EQ(estimate.torque_nm[1], 3.5);
  EXPECT_DOUBLE_EQ(estimate.sigma_nm[1], 0.25);
}

}  // namespace
}  // namespace cutforce::firmware::host
