// The whole simulated machine: determinism, energy, drive, inverter, feed and cut.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "hal/host/simulation/arithmetic.hpp"
#include "hal/host/simulation/simulation_port.hpp"
#include "support/simulation_support.hpp"

namespace cutforce {
namespace {

using namespace hal::host;  // NOLINT: the whole file is about it
using hal::Command;
using hal::Sample;
using hal::Signal;
using host_tests::Row;
using host_tests::run_open_loop;

SimulatedMachineConfig loaded_motor_a() {
  SimulatedMachineConfig config = motor_a();
  config.load.torque_nm = ramped_steps(0.0, {{1.0, 5.84}, {1.6, 0.0}}, 0.03);
  return config;
}

SimulatedMachineConfig noisy_lathe() {
  SimulatedMachineConfig config = default_lathe();
  for (auto& channel : config.sensors.voltage) channel.noise = 1.0;
  for (auto& channel : config.sensors.current) channel.noise = 0.1;
  config.sensors.speed.noise_rad_s = 0.05;
  config.sensors.power_meter.noise_w = 20.0;
  config.sensors.dynamometer = {.present = true, .noise_n = 4.0};
  return config;
}

bool same(const Sample& a, const Sample& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

TEST(SimulatedMachine, RepeatsItselfBitForBitFromOneSeed) {
  const auto first = run_open_loop(noisy_lathe(), 0.5);
  const auto second = run_open_loop(noisy_lathe(), 0.5);
  SimulatedMachineConfig other = noisy_lathe();
  other.seed = 2;
  const auto third = run_open_loop(other, 0.5);
  ASSERT_EQ(first.size(), 2501U);
  int differing = 0;
  for (std::size_t k = 0; k < first.size(); ++k) {
    ASSERT_TRUE(same(first[k].sample, second[k].sample)) << k;
    differing += !same(first[k].sample, third[k].sample);
    ASSERT_EQ(first[k].truth.airgap_torque_nm, third[k].truth.airgap_torque_nm)
        << "the sensors' chance must not reach the machine";
  }
  EXPECT_EQ(differing, 2501);
}

TEST(SimulatedMachine, ACopyGoesOnAsTheOriginalWould) {
  auto original = SimulatedMachine::make(noisy_lathe()).value();
  for (int k = 0; k < 3000; ++k) original.advance();
  auto copy = original;
  for (int k = 0; k < 1000; ++k) ASSERT_TRUE(same(original.advance(), copy.advance())) << k;
}

TEST(SimulatedMachine, NoiseOnOneChannelMovesNoOther) {
  SimulatedMachineConfig quieter = noisy_lathe();
  quieter.sensors.current[0].noise = 0.0;
  const auto a = run_open_loop(noisy_lathe(), 0.2);
  const auto b = run_open_loop(quieter, 0.2);
  for (std::size_t k = 0; k < a.size(); ++k) {
    ASSERT_EQ(a[k].sample.current_a[1], b[k].sample.current_a[1]);
    ASSERT_EQ(a[k].sample.voltage_v, b[k].sample.voltage_v);
    ASSERT_EQ(a[k].sample.speed_rad_s, b[k].sample.speed_rad_s);
  }
}

TEST(SimulatedMachine, SamplesAtWholeNanosecondsWithoutDrift) {
  SimulatedMachineConfig config = motor_a();
  config.sample_rate_hz = 3000.0;
  auto machine = SimulatedMachine::make(config).value();
  for (int k = 0; k < 3000; ++k) {
    ASSERT_EQ(machine.advance().time_ns, static_cast<std::int64_t>(std::llround(k * 1e9 / 3000.0)));
  }
  EXPECT_EQ(machine.advance().time_ns, 1'000'000'000);
}

TEST(SimulatedMachine, GivesTheSameSignalsWhateverItsIntegrationStep) {
  const auto coarse = run_open_loop(loaded_motor_a(), 2.0);
  SimulatedMachineConfig config = loaded_motor_a();
  config.integration_step_s = 20e-6;
  const auto fine = run_open_loop(config, 2.0);
  double torque_nm = 0.0;
  double current_a = 0.0;
  for (std::size_t k = 0; k < coarse.size(); ++k) {
    torque_nm = std::max(
        torque_nm, std::abs(coarse[k].truth.airgap_torque_nm - fine[k].truth.airgap_torque_nm));
    current_a = std::max(current_a, magnitude(host_tests::current_of(coarse[k].sample) -
                                              host_tests::current_of(fine[k].sample)));
  }
  EXPECT_LT(torque_nm, 1e-5);
  EXPECT_LT(current_a, 5e-5);  // of 11 A at the peak of the run-up
}

TEST(SimulatedMachine, TurnsTheTorqueLeftOverIntoKineticEnergy) {
  const auto rows = run_open_loop(loaded_motor_a(), 2.0);
  double work_j = 0.0;
  double gross_j = 0.0;
  for (std::size_t k = 1; k < rows.size(); ++k) {
    const auto power_w = [](const MachineTruth& t) {
      return (t.airgap_torque_nm - t.load_torque_nm) * t.speed_rad_s;
    };
    const double step_j = 0.5 * 200e-6 * (power_w(rows[k - 1].truth) + power_w(rows[k].truth));
    work_j += step_j;
    gross_j += std::abs(step_j);
    const double kinetic_j = 0.5 * 0.03 * rows[k].truth.speed_rad_s * rows[k].truth.speed_rad_s;
    // The trapezoid of 200 us samples is what is coarse here.
    ASSERT_NEAR(work_j, kinetic_j, 1e-3 * gross_j + 0.05) << k;
  }
}

TEST(SimulatedMachine, KeepsInputPowerEqualToLossesAndAirGapAtAPlateau) {
  const auto rows = run_open_loop(loaded_motor_a(), 1.58);
  const MachineTruth& t = rows.back().truth;
  double copper_w = 0.0;
  double input_w = 0.0;
  int count = 0;
  for (std::size_t k = rows.size() - 500; k < rows.size(); ++k, ++count) {
    copper_w += 1.5 * 3.7 * squared(host_tests::current_of(rows[k].sample));
    input_w += rows[k].truth.input_power_w;
  }
  const double supply_rad_s = 2.0 * t.speed_rad_s + t.slip_speed_rad_s;
  EXPECT_NEAR(input_w / count, copper_w / count + t.airgap_torque_nm * supply_rad_s / 2.0,
              1e-3 * input_w / count);
}

TEST(Drive, HoldsTheSpeedUnderVectorControlAndDropsItUnderVoltsPerHertz) {
  SimulatedMachineConfig config = loaded_motor_a();
  config.load.torque_nm = ramped_steps(0.0, {{1.2, 8.76}}, 0.03);
  const auto speed_at_the_end = [&] { return run_open_loop(config, 3.0).back().truth.speed_rad_s; };
  EXPECT_NEAR(speed_at_the_end(), 157.0796, 1e-3);

  config.drive.control = DriveControl::kVoltsPerHertz;
  const double open = speed_at_the_end();
  EXPECT_LT(open, 153.5);
  EXPECT_GT(open, 152.0);
  config.drive.slip_compensation_ratio = 1.0;
  EXPECT_NEAR(speed_at_the_end(), 157.08, 0.6);
}

TEST(Drive, KeepsTorqueAndCurrentWithinTheirLimits) {
  SimulatedMachineConfig config = motor_a();
  config.drive.speed_reference_rad_s = Profile{{0.0, 0.0}, {0.2, 0.0}, {0.2, 150.0}};
  config.drive.torque_limit_nm = 10.0;
  const auto rows = run_open_loop(config, 1.5);
  double most = 0.0;
  for (const Row& row : rows) most = std::max(most, row.truth.airgap_torque_nm);
  EXPECT_LT(most, 10.3);
  EXPECT_GT(most, 9.7);
  EXPECT_NEAR(rows.back().truth.speed_rad_s, 150.0, 0.01);
}

TEST(Drive, RunsEveryPresetAtThreeHundredAndTwentyFourHundredTurns) {
  for (const auto& preset : {motor_a(), motor_b(), default_lathe()}) {
    for (const double rpm : {300.0, 2400.0}) {
      SCOPED_TRACE(testing::Message() << preset.motor.rated_torque_nm << " Nm at " << rpm);
      SimulatedMachineConfig config = preset;
      const double speed = rpm * kTwoPi / 60.0;
      config.drive.speed_reference_rad_s = Profile{{0.0, 0.0}, {0.3, 0.0}, {2.3, speed}};
      config.process.specific_force_n_m2 = 0.0;
      config.load.torque_nm = ramped_steps(0.0, {{3.2, 0.4 * preset.motor.rated_torque_nm}}, 0.03);
      const auto rows = run_open_loop(config, 5.0);
      EXPECT_NEAR(rows.back().truth.speed_rad_s, speed, 0.02);
      EXPECT_NEAR(rows.back().truth.airgap_torque_nm, rows.back().truth.load_torque_nm, 0.02);
      EXPECT_LT(magnitude(host_tests::current_of(rows.back().sample)),
                1.5 * std::sqrt(2.0) * preset.motor.rated_current_a_rms);
    }
  }
}

TEST(SimulatedMachine, DrawsItsRatedCurrentAndSlipAtItsRatedTorque) {
  const std::array presets{motor_a(), motor_b(), default_lathe()};
  const std::array slip_ratio{0.041, 0.033, 0.04};
  for (std::size_t k = 0; k < presets.size(); ++k) {
    SCOPED_TRACE(presets[k].motor.rated_torque_nm);
    SimulatedMachineConfig config = presets[k];
    config.process.specific_force_n_m2 = 0.0;
    config.load_friction = {};
    config.drive.speed_reference_rad_s = Profile{{0.0, 0.0}, {0.2, 0.0}, {1.4, 120.0}};
    config.load.torque_nm = ramped_steps(0.0, {{2.0, config.motor.rated_torque_nm}}, 0.03);
    const auto rows = run_open_loop(config, 3.5);
    const MachineTruth& t = rows.back().truth;
    EXPECT_NEAR(magnitude(host_tests::current_of(rows.back().sample)) / std::sqrt(2.0),
                config.motor.rated_current_a_rms, 0.1 * config.motor.rated_current_a_rms);
    // At 120 rad/s the field is whole: the rated slip in rad/s is that of the rated speed.
    EXPECT_NEAR(t.slip_speed_rad_s / config.motor.rated_speed_rad_s, slip_ratio[k], 0.005);
  }
}

TEST(Inverter, SwitchesTheMeanThatItsDutiesAskFor) {
  constexpr double kHold = 125e-6;
  for (const double dead_s : {0.0, 2e-6}) {
    Inverter inverter({.dc_link_v = 540.0, .dead_time_s = dead_s}, kHold);
    const Complex current{3.0, -1.0};
    Complex sum_vs;
    Complex wanted_vs;
    for (int hold = 0; hold < 2000; ++hold) {
      const auto [sine, cosine] = sine_cosine(0.01 * hold);
      const auto duty = inverter.duties({250.0 * cosine, 250.0 * sine});
      wanted_vs += kHold * inverter.mean_v(duty, current);
      inverter.begin_hold(duty, current);
      std::int64_t at_ns = 0;
      for (const auto* edge = inverter.next_edge(); edge != nullptr; edge = inverter.next_edge()) {
        sum_vs += (1e-9 * static_cast<double>(edge->offset_ns - at_ns)) * inverter.switched_v();
        at_ns = edge->offset_ns;
        inverter.take_edge();
      }
      sum_vs += (1e-9 * static_cast<double>(125000 - at_ns)) * inverter.switched_v();
    }
    EXPECT_NEAR(magnitude(sum_vs - wanted_vs), 0.0, 540.0 * kHold);  // of one edge
  }
}

TEST(Inverter, LosesVoltageAgainstTheCurrentToDeadTimeAndDrop) {
  const Inverter ideal({.dc_link_v = 540.0}, 125e-6);
  const Inverter real({.dc_link_v = 540.0, .dead_time_s = 2e-6, .device_drop_v = 1.5}, 125e-6);
  const auto duty = ideal.duties({200.0, 0.0});
  const Complex current{5.0, 0.0};
  const Complex lost = ideal.mean_v(duty, current) - real.mean_v(duty, current);
  // 4/3 of one phase's loss along a current in phase u: 540 V * 2 us / 250 us + 1.5 V.
  EXPECT_NEAR(lost.re, 4.0 / 3.0 * (540.0 * 2e-6 / 250e-6 + 1.5), 1e-9);
  EXPECT_NEAR(lost.im, 0.0, 1e-9);
}

SimulatedMachineConfig switched_motor_a() {
  SimulatedMachineConfig config = loaded_motor_a();
  config.inverter.switched = true;
  config.sensors.voltage_signal = VoltageSignal::kInstantaneous;
  return config;
}

TEST(Inverter, ShowsRawSwitchingAsEightVoltagesAndOftenNone) {
  const auto rows = run_open_loop(switched_motor_a(), 1.5);
  int none = 0;
  int count = 0;
  for (const Row& row : rows) {
    if (row.time_s() < 1.2) continue;
    const double volt = magnitude(host_tests::voltage_of(row.sample));
    EXPECT_TRUE(volt < 1e-3 || std::abs(volt - 360.0) < 1e-3) << volt;
    none += volt < 18.0;
    ++count;
  }
  EXPECT_NEAR(none / double(count), 0.2, 0.05);
}

TEST(Inverter, LeavesTheTrueTorqueBehindEqualAntiAliasFilters) {
  SimulatedMachineConfig config = switched_motor_a();
  config.inverter.anti_alias_hz = 1600.0;
  const auto switched = run_open_loop(config, 1.55);
  const auto averaged = run_open_loop(loaded_motor_a(), 1.55);
  double torque_nm = 0.0;
  double power_w = 0.0;
  double reference_w = 0.0;
  int count = 0;
  for (std::size_t k = averaged.size() - 1000; k < averaged.size(); ++k, ++count) {
    torque_nm += switched[k].truth.airgap_torque_nm - averaged[k].truth.airgap_torque_nm;
    const auto p = [](const Sample& s) {
      return 1.5 * dot(host_tests::voltage_of(s), host_tests::current_of(s));
    };
    power_w += p(switched[k].sample);
    reference_w += p(averaged[k].sample);
  }
  EXPECT_NEAR(torque_nm / count, 0.0, 0.01);
  EXPECT_NEAR(power_w / reference_w, 1.0, 0.01);
}

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

TEST(SimulationPort, NeverReadsPastTheEndOfAControlPeriod) {
  for (const double rate_hz : {1000.0, 3000.0, 5000.0, 20000.0}) {
    SimulatedMachineConfig config = motor_a();
    config.sample_rate_hz = rate_hz;
    auto machine = SimulatedMachine::make(config).value();
    SimulationPort port(machine, 0.05, 0.5);
    std::array<Sample, 256> block{};
    std::size_t total = 0;
    for (;;) {
      const auto count = port.read(block).value();
      if (count == 0) break;
      total += count;
      for (std::size_t k = 1; k < count; ++k) {
        ASSERT_EQ((block[k].time_ns + 1) / 50'000'000, (block[0].time_ns + 1) / 50'000'000);
      }
    }
    EXPECT_EQ(total, static_cast<std::size_t>(rate_hz * 0.5) + 1);
    EXPECT_EQ(port.read(block).value(), 0U);
  }
}

// A plain integral law on the true force: what counts is that the loop is closed.
TEST(SimulationPort, ClosesTheLoopOnTheForce) {
  auto machine = SimulatedMachine::make(default_lathe()).value();
  SimulationPort port(machine, 0.05, 9.0);
  std::array<Sample, 64> block{};
  double override_pct = 100.0;
  double lowest = 1e9;
  double highest = 0.0;
  std::int64_t tick = 1;
  while (const auto count = port.read(block).value()) {
    const Sample& last = block[count - 1];
    const MachineTruth& truth = machine.truth();
    if (truth.depth_m > 0.0 && last.time_ns > 5'000'000'000) {
      highest = std::max(highest, truth.cutting_force_n);
      lowest = std::min(lowest, truth.cutting_force_n);
    }
    if (last.time_ns < tick * 50'000'000) continue;
    ++tick;
    if (truth.depth_m > 0.0) override_pct += 0.05 * 0.8 * (500.0 - truth.cutting_force_n);
    override_pct = std::clamp(override_pct, 20.0, 200.0);
    const auto code = static_cast<std::uint8_t>(std::lround(override_pct));
    ASSERT_TRUE(port.write({last.time_ns, code, code, true}));
  }
  EXPECT_GT(highest, 520.0);  // the step from 1 to 1.5 mm must be felt ...
  EXPECT_LT(highest, 760.0);  // ... and answered
  EXPECT_GT(lowest, 400.0);
  EXPECT_NEAR(machine.truth().override_pct, override_pct, 1.0);
}

TEST(SimulatedMachine, WritesRecordings) {
  const auto path = std::filesystem::temp_directory_path() / "cutforce_simulated_recording.csv";
  host_tests::write_recording(default_lathe(), 0.01, path);
  std::ifstream file(path);
  std::string line;
  ASSERT_TRUE(std::getline(file, line));
  EXPECT_EQ(line, "# cutforce recording 1");
  int rows = 0;
  while (std::getline(file, line)) rows += line[0] >= '0' && line[0] <= '9';
  EXPECT_EQ(rows, 51);
  std::filesystem::remove(path);
}

TEST(SimulatedMachine, ShowsNoTruthInItsSamples) {
  const auto rows = run_open_loop(default_lathe(), 0.01);
  const Sample& s = rows.back().sample;
  EXPECT_FALSE(s.has(Signal::kMeasuredForce));
  EXPECT_EQ(s.measured_force_n, 0.0F);
  EXPECT_FALSE(s.has(Signal::kEnable));
  EXPECT_TRUE(s.has(Signal::kSpeed));
}

}  // namespace
}  // namespace cutforce
