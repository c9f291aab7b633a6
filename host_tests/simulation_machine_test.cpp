// The simulated machine as a whole: determinism, energy, what it shows.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <string>

#include "hal/host/simulation/arithmetic.hpp"
#include "support/scratch_folder.hpp"
#include "support/simulation_support.hpp"

namespace cutforce {
namespace {

using namespace hal::host;  // NOLINT: the whole file is about it
using hal::Sample;
using hal::Signal;
using host_tests::loaded_motor_a;
using host_tests::run_open_loop;

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

TEST(SimulatedMachine, WritesRecordings) {
  const host_tests::ScratchFolder folder;
  const auto path = folder.file("simulated.csv");
  host_tests::write_recording(default_lathe(), 0.01, path);
  std::ifstream file(path);
  std::string line;
  ASSERT_TRUE(std::getline(file, line));
  EXPECT_EQ(line, "# cutforce recording 1");
  int rows = 0;
  while (std::getline(file, line)) rows += line[0] >= '0' && line[0] <= '9';
  EXPECT_EQ(rows, 51);
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
