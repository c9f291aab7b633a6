// Feed and cut of the simulated machine.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "hal/host/simulation/simulated_machine.hpp"

namespace cutforce {
namespace {

using namespace hal::host;  // NOLINT: the whole file is about it

TEST(FeedServo, ActsAfterScanAndLatencyWhateverThePhase) {
  double least = 1.0;
  double most = 0.0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    FeedServo servo({.feed_m_s = 1e-3, .length_m = 1.0, .latency_s = 0.025, .scan_s = 0.020},
                    125e-6, seed);
    int k = 0;
    for (; k < 8000; ++k) servo.step(125e-6 * k, 0.0);
    servo.set_override(60.0);
    const int begin = k;
    while (servo.state().override_pct > 99.0) servo.step(125e-6 * k++, 0.0);
    const double delay_s = 125e-6 * (k - begin);
    least = std::min(least, delay_s);
    most = std::max(most, delay_s);
  }
  EXPECT_NEAR(least, 0.025, 0.0005);
  EXPECT_NEAR(most, 0.045, 0.0005);
}

TEST(FeedServo, LagsAsFirstOrderAndKeepsTheDistance) {
  FeedServo servo({.feed_m_s = 1e-3, .length_m = 1.0, .lag_s = 0.03}, 125e-6, 1);
  for (int k = 0; k < 240; ++k) servo.step(125e-6 * k, 0.0);
  EXPECT_NEAR(servo.state().feed_m_s, 1e-3 * (1.0 - std::exp(-1.0)), 1e-12);
  EXPECT_NEAR(servo.state().position_m, 1e-3 * (0.03 - 0.03 * (1.0 - std::exp(-1.0))), 1e-12);
}

TEST(FeedServo, StopsAtTheEndOfThePath) {
  FeedServo servo({.feed_m_s = 0.01, .length_m = 0.002}, 1e-3, 1);
  for (int k = 0; k < 1000; ++k) servo.step(1e-3 * k, 0.0);
  EXPECT_FALSE(servo.state().feeding);
  EXPECT_NEAR(servo.state().position_m, 0.002, 1e-5 + 1e-9);
}

constexpr ProcessInput kSteadyCut{.time_s = 0.0,
                                  .position_m = 0.010,
                                  .feed_m_s = 0.2e-3 * 20.0,
                                  .spindle_turns_s = 20.0,
                                  .spindle_turns = 0.0,
                                  .motor_speed_rad_s = 125.0};

CuttingProcess process_with(const ProcessConfig& config, double gear = 1.0) {
  return CuttingProcess{config, {}, {}, gear, 1e-3};
}
ProcessConfig plain_process() {
  return {.specific_force_n_m2 = 2e9,
          .nominal_feed_m_rev = 0.2e-3,
          .lag_s = 0.1,
          .depth_m = Profile{1e-3},
          .diameter_m = Profile{0.05}};
}

TEST(CuttingProcess, AnswersAStepOfDepthAsAFirstOrderLag) {
  auto process = process_with(plain_process());
  for (int k = 1; k <= 300; ++k) {
    process.step(kSteadyCut);
    ASSERT_NEAR(process.state().force_n, 400.0 * (1.0 - std::exp(-0.01 * k)), 1e-9);
  }
  EXPECT_NEAR(process.state().cutting_torque_nm, process.state().force_n * 0.025, 1e-12);
}

TEST(CuttingProcess, ScalesWithFeedDepthWearHardSpotsAndDiameter) {
  ProcessConfig config = plain_process();
  config.exponent = 0.864;
  config.depth_m = Profile{{0.0, 1e-3}, {0.02, 3e-3}};
  config.diameter_m = Profile{{0.0, 0.10}, {0.02, 0.02}};
  config.wear_ratio = Profile{{0.0, 1.0}, {10.0, 1.5}};
  config.hard_spots = {{0.012, 0.013, 1.6}};
  auto process = process_with(config, 2.0);
  ProcessInput input = kSteadyCut;
  EXPECT_NEAR(process.static_force_n(input), 800.0, 1e-9);
  input.feed_m_s *= 0.5;
  EXPECT_NEAR(process.static_force_n(input), 800.0 * std::pow(0.5, 0.864), 1e-9);
  input = kSteadyCut;
  input.time_s = 5.0;
  EXPECT_NEAR(process.static_force_n(input), 1000.0, 1e-9);
  input = kSteadyCut;
  input.position_m = 0.0125;
  EXPECT_NEAR(process.static_force_n(input), 1.6 * 400.0 * 2.25, 1e-9);
  for (int k = 0; k < 3000; ++k) process.step(kSteadyCut);
  EXPECT_NEAR(process.state().cutting_torque_nm, 800.0 * 0.03 / 2.0, 1e-9);
  input = kSteadyCut;
  input.spindle_turns_s = 0.0;
  EXPECT_EQ(process.static_force_n(input), 0.0);
}

TEST(CuttingProcess, InterruptsTheCutForTheShareOfATurnThatIsMissing) {
  ProcessConfig config = plain_process();
  config.slots_per_turn = 2.0;
  config.slot_ratio = 0.15;
  config.slots_begin_m = 0.0;
  config.slots_end_m = 1.0;
  auto process = process_with(config);
  int empty = 0;
  for (int k = 0; k < 10000; ++k) {
    ProcessInput input = kSteadyCut;
    input.spindle_turns = k * 1e-3;
    empty += process.static_force_n(input) == 0.0;
  }
  EXPECT_NEAR(empty, 1500, 25);
}

TEST(CuttingProcess, AddsTheFrictionOfTheLoadAndOscillates) {
  CuttingProcess process(
      {}, {.torque_nm = Profile{10.0}, .oscillations = {{1.0, 2.0, 2.0, 15.0}}},
      {.ratio = Profile{{0.0, 0.05}, {250.0, 0.07}}, .per_nm_1_nm = Profile{0.0015}}, 1.0, 1e-3);
  ProcessInput input = kSteadyCut;
  process.step(input);
  EXPECT_NEAR(process.state().load_torque_nm, 10.0 + 0.06 * 10.0 + 0.0015 * 100.0, 1e-12);
  input.time_s = 1.0 + 1.0 / 60.0;
  process.step(input);
  EXPECT_NEAR(process.state().cutting_torque_nm, 12.0, 1e-9);
}

}  // namespace
}  // namespace cutforce
