// The plant of the force loop, found in recordings of which the truth is known.
#include "firmware/host/design/identify.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "firmware/host/compare/part.hpp"
#include "firmware/host/design/latency_bank.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

using namespace firmware::host;
using hal::host::ForceMachine;
using hal::host::ForceMachineConfig;

// Process lag alone, besides a dead time: the model's own plant.
ForceMachineConfig plain_lathe(std::uint64_t seed) {
  auto machine = comparison_lathe();
  machine.seed = seed;
  machine.starts_in_cut = true;
  machine.feed.initial_override_pct = 100.0;
  machine.feed.length_m = 10.0;
  machine.feed.scan_s = 0.0;
  machine.feed.latency_s = 0.08;
  machine.feed.lag_s = 0.0;
  machine.process.depth_m = hal::host::Profile{1e-3};
  machine.sensor = {.noise_ratio = 0.02, .noise_n = 4.0, .noise_correlation_s = 0.03};
  return machine;
}

const std::vector<double> kLevels{100, 130, 100, 80, 100, 130, 80, 100, 120, 90, 130, 80};

StepTest step_test(const ForceMachineConfig& config, const std::vector<double>& levels,
                   double hold_s = 1.7) {
  auto machine = ForceMachine::make(config).value();
  StepTest test{.where = "test",
                .force_column = "measured_force_n",
                .time_s = {},
                .force_n = {},
                .changes = {}};
  double next_s = 0.0;
  std::size_t level = 0;
  while (level < levels.size() || machine.time_s() < next_s) {
    const double now_s = machine.time_s();
    test.time_s.push_back(now_s);
    test.force_n.push_back(static_cast<double>(machine.read().measured_force_n));
    if (now_s >= next_s && level < levels.size()) {
      if (test.changes.empty() || test.changes.back().override_pct != levels[level])
        test.changes.push_back({now_s, levels[level]});
      machine.set_override(levels[level++]);
      next_s += hold_s;
    }
    for (std::uint32_t k = 0; k < machine.steps_per_sample(); ++k) machine.step();
  }
  return test;
}

double sigmas(const Measured& found, double truth) {
  return std::abs(found.value - truth) / found.sigma;
}

// 400 N (u/100)^0.864.
double true_gain(double override_pct) {
  return 4.0 * 0.864 * std::pow(override_pct / 100.0, 0.864 - 1.0);
}

TEST(Identify, FindsTheTruthWithoutNoise) {
  auto config = plain_lathe(1);
  config.sensor = {};
  const auto plant = identify(step_test(config, kLevels), {0.0, 0.0});
  ASSERT_TRUE(plant) << plant.error().text();
  EXPECT_NEAR(plant->gain_n_pct.value, true_gain(plant->override_pct), 0.01);
  EXPECT_NEAR(plant->exponent.value, 0.864, 0.002);
  EXPECT_NEAR(plant->dead_time_s.value, 0.08, 0.002);  // the simulation's step
  EXPECT_NEAR(plant->lag_s.value, 0.1, 0.002);
  EXPECT_TRUE(plant->exponent_known);
}

// The stated uncertainty is honest: errors over many seeds are neither smaller nor larger than it
// says, and next to none is beyond three times it.
TEST(Identify, StatesHowFarItMayBeOff) {
  constexpr int kSeeds = 200;
  std::array<double, 4> squares{};
  int beyond_three = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const auto plant = identify(step_test(plain_lathe(seed), kLevels), {0.0, 0.0});
    ASSERT_TRUE(plant) << plant.error().text();
    const std::array<double, 4> off{sigmas(plant->gain_n_pct, true_gain(plant->override_pct)),
                                    sigmas(plant->exponent, 0.864),
                                    sigmas(plant->dead_time_s, 0.081), sigmas(plant->lag_s, 0.1)};
    for (std::size_t k = 0; k < off.size(); ++k) {
      beyond_three += off[k] > 3.0 ? 1 : 0;
      EXPECT_LT(off[k], 4.5) << k;
      squares[k] += off[k] * off[k] / kSeeds;
    }
  }
  EXPECT_LE(beyond_three, 8);  // of 800; a normal distribution has 2
  for (const double square : squares) {
    EXPECT_GT(std::sqrt(square), 0.85);
    EXPECT_LT(std::sqrt(square), 1.2);
  }
}

// Scan, feed drive and sensor: with their lags given, what is left is found; the scan alone
// moves the dead time, by up to its length.
TEST(Identify, TakesKnownLagsAsTheyAre) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    auto config = comparison_lathe();
    const auto plain = plain_lathe(seed);
    config.seed = seed;
    config.starts_in_cut = true;
    config.feed.initial_override_pct = 100.0;
    config.feed.length_m = 10.0;
    config.process.depth_m = plain.process.depth_m;
    config.sensor.noise_ratio = 0.02;
    config.sensor.noise_n = 4.0;
    const auto test = step_test(config, kLevels);
    const auto plant = identify(test, {0.03, 0.03});
    ASSERT_TRUE(plant) << plant.error().text();
    EXPECT_GT(plant->dead_time_s.value, 0.025 - 3.0 * plant->dead_time_s.sigma);
    EXPECT_LT(plant->dead_time_s.value, 0.045 + 3.0 * plant->dead_time_s.sigma);
    EXPECT_LT(sigmas(plant->lag_s, 0.1), 3.0);
    // Unknown, they become dead time and lag: their sum stays.
    const auto blind = identify(test, {0.0, 0.0});
    ASSERT_TRUE(blind) << blind.error().text();
    EXPECT_NEAR(blind->dead_time_s.value + blind->lag_s.value,
                plant->dead_time_s.value + plant->lag_s.value + 0.06, 0.02);
  }
}

TEST(Identify, TellsAGainButNoExponentFromTwoLevels) {
  const auto plant =
      identify(step_test(plain_lathe(3), {100, 120, 100, 120, 100, 120, 100, 120}), {0.0, 0.0});
  ASSERT_TRUE(plant) << plant.error().text();
  EXPECT_FALSE(plant->exponent_known);
  EXPECT_LT(sigmas(plant->gain_n_pct, true_gain(plant->override_pct)), 3.0);
}

TEST(Identify, RefusesWhatTellsNothing) {
  struct Case {
    const char* says;
    StepTest test;
  };
  auto backwards = step_test(plain_lathe(1), kLevels);
  for (double& force_n : backwards.force_n) force_n = 900.0 - force_n;
  auto other_cut = step_test(plain_lathe(1), kLevels);
  for (std::size_t k = 0; k < other_cut.time_s.size(); ++k)
    other_cut.force_n[k] += 200.0 * std::sin(2.0 * other_cut.time_s[k]);
  auto deaf = plain_lathe(1);
  deaf.sensor.noise_ratio = 0.0;
  deaf.sensor.noise_n = 0.0;
  auto constant = step_test(deaf, kLevels);
  for (double& force_n : constant.force_n) force_n = 400.0;
  const std::vector<Case> table{
      {"no step", step_test(plain_lathe(1), {100, 100, 100})},
      {"no step", step_test(plain_lathe(1), {100, 100.4, 100})},
      {"explains only", step_test(plain_lathe(1), {100, 101, 100, 101, 100})},
      {"does not rise", backwards},
      {"does not rise", constant},
      {"explains only", other_cut},
  };
  for (const auto& [says, test] : table) {
    SCOPED_TRACE(says);
    const auto plant = identify(test, {0.0, 0.0});
    ASSERT_FALSE(plant);
    EXPECT_NE(plant.error().what.find(says), std::string::npos) << plant.error().text();
    EXPECT_FALSE(plant.error().remedy.empty());
  }
}

TEST(Identify, SeesALoadThatDriftsByItself) {
  auto config = plain_lathe(5);
  config.process.wear_ratio = hal::host::Profile{{0.0, 1.0}, {20.0, 1.3}};
  const auto plant = identify(step_test(config, kLevels), {0.0, 0.0});
  ASSERT_TRUE(plant) << plant.error().text();
  EXPECT_GT(plant->slow_residual, 0.3);
  const auto quiet = identify(step_test(plain_lathe(5), kLevels), {0.0, 0.0});
  ASSERT_TRUE(quiet);
  EXPECT_LT(quiet->slow_residual, 0.15);
}

// Both find the same dead time, by different means.
TEST(LatencyBank, AgreesWithTheLeastSquares) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    for (const double latency_s : {0.03, 0.1, 0.25}) {
      auto config = plain_lathe(seed);
      config.feed.latency_s = latency_s;
      const auto test = step_test(config, kLevels);
      const auto plant = identify(test, {0.0, 0.0});
      ASSERT_TRUE(plant) << plant.error().text();
      const auto bank = latency_bank(test, *plant, 0.05, 0.04);
      ASSERT_TRUE(bank);
      EXPECT_NEAR(bank->best_s, latency_s, 0.04);
      EXPECT_GT(bank->cost.back(), 1.2);
    }
  }
}

TEST(LatencyBank, SaysNothingWhereTooLittleMoves) {
  auto config = plain_lathe(1);
  config.sensor.noise_ratio = 0.005;
  const auto test = step_test(config, {100, 104, 100, 104, 100, 104, 100}, 3.0);
  const auto plant = identify(test, {0.0, 0.0});
  ASSERT_TRUE(plant) << plant.error().text();
  EXPECT_FALSE(latency_bank(test, *plant, 0.05, 0.04));
}

TEST(StepTest, ReadsARecordingOrATrace) {
  ScratchFolder folder;
  std::string trace = "# cutforce trace 1\nt_s,cutting_force_n,override_pct\n";
  std::string both = "# cutforce recording 1\nt_s,override_pct,measured_force_n,cutting_force_n\n";
  for (int k = 0; k < 60; ++k) {
    const auto t = std::to_string(0.05 * k);
    trace += t + "," + (k < 5 ? "" : "400") + "," + (k < 30 ? "100" : "120") + "\n";
    both += t + "," + (k == 40 ? "" : k < 30 ? "100" : "120") + ",300,400\n";
  }
  const auto read = [&](const std::string& text, Stretch stretch) {
    return read_step_test(folder.write("test.csv", text), stretch);
  };
  constexpr double kEnd = 1e9;
  const auto from_trace = read(trace, {0.0, kEnd});
  ASSERT_TRUE(from_trace) << from_trace.error().text();
  EXPECT_EQ(from_trace->force_column, "cutting_force_n");
  EXPECT_EQ(from_trace->time_s.size(), 55U);
  ASSERT_EQ(from_trace->changes.size(), 2U);
  EXPECT_DOUBLE_EQ(from_trace->changes[1].time_s, 1.5);

  const auto from_recording = read(both, {1.0, kEnd});
  ASSERT_TRUE(from_recording);
  EXPECT_EQ(from_recording->force_column, "measured_force_n");
  EXPECT_EQ(from_recording->time_s.size(), 40U);
  EXPECT_EQ(from_recording->changes.size(), 2U);

  const auto refused = [&](const std::string& text, Stretch stretch, const char* says) {
    const auto got = read(text, stretch);
    ASSERT_FALSE(got) << says;
    EXPECT_NE(got.error().text().find(says), std::string::npos) << got.error().text();
  };
  refused(trace, {2.5, kEnd}, "in this stretch");
  refused("t_s,cutting_force_n\n0,1\n", {0.0, kEnd}, "override_pct");
  refused("t_s,override_pct\n0,100\n", {0.0, kEnd}, "no force");
  refused("t_s,override_pct,cutting_force_n\n0,0,100\n", {0.0, kEnd}, "override of 0");
  refused("t_s,override_pct,cutting_force_n\n0,x,100\n", {0.0, kEnd}, ":2");
}

}  // namespace
}  // namespace cutforce::host_tests
