// Drive and inverter of the simulated machine.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "hal/host/simulation/arithmetic.hpp"
#include "support/simulation_support.hpp"

namespace cutforce {
namespace {

using namespace hal::host;  // NOLINT: the whole file is about it
using hal::Sample;
using host_tests::loaded_motor_a;
using host_tests::Row;
using host_tests::run_open_loop;

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

}  // namespace
}  // namespace cutforce
