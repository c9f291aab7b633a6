// Every defect does what it says, and nothing else.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "hal/host/simulation/arithmetic.hpp"
#include "support/simulation_support.hpp"

namespace cutforce {
namespace {

using namespace hal::host;  // NOLINT: the whole file is about it
using hal::Sample;
using hal::Signal;
using host_tests::Row;
using host_tests::run_open_loop;

TEST(Channel, AppliesGainAndOffsetThenResolutionThenRange) {
  Channel channel({.gain = 1.02, .offset = 0.5, .range = 10.0, .bits = 4.0}, 1, 1);
  EXPECT_DOUBLE_EQ(channel.read(1.0), 1.25);    // 1.52 in steps of 1.25
  EXPECT_DOUBLE_EQ(channel.read(100.0), 8.75);  // the last code
  EXPECT_DOUBLE_EQ(channel.read(-100.0), -10.0);
  std::set<double> codes;
  for (int k = -2000; k <= 2000; ++k) codes.insert(channel.read(0.01 * k));
  EXPECT_EQ(codes.size(), 16U);
}

TEST(Channel, AddsWhiteNoiseOfTheStatedDeviation) {
  Channel channel({.noise = 0.3}, 5, 1);
  double sum = 0.0;
  double squares = 0.0;
  double neighbours = 0.0;
  double before = 0.0;
  constexpr int kCount = 100000;
  for (int k = 0; k < kCount; ++k) {
    const double x = channel.read(2.0) - 2.0;
    sum += x;
    squares += x * x;
    neighbours += x * before;
    before = x;
  }
  EXPECT_NEAR(sum / kCount, 0.0, 0.005);
  EXPECT_NEAR(std::sqrt(squares / kCount), 0.3, 0.003);
  EXPECT_NEAR(neighbours / kCount, 0.0, 0.0015);
}

TEST(SpeedSensor, LagsRipplesAndCounts) {
  SpeedSensor lagged({.lag_s = 0.01}, 1e-3, 1);
  double seen = 0.0;
  for (int k = 0; k < 10; ++k) seen = lagged.read(100.0, 0.0);
  EXPECT_NEAR(seen, 100.0 * (1.0 - std::exp(-1.0)), 1e-9);

  SpeedSensor rippling({.ripple_ratio = 0.01, .second_ripple_ratio = 0.002}, 1e-3, 1);
  EXPECT_NEAR(rippling.read(100.0, 0.0), 101.2, 1e-9);
  EXPECT_NEAR(rippling.read(100.0, kPi / 2.0), 99.8, 1e-9);

  SpeedSensor counting({.encoder_counts = 1024.0, .encoder_window_s = 2e-3}, 1e-3, 1);
  std::set<double> values;
  double mean = 0.0;
  for (int k = 0; k < 2000; ++k) {
    const double x = counting.read(157.0, 0.157 * k);
    if (k < 10) continue;
    values.insert(std::round(x * 1e6));
    mean += x / 1990.0;
  }
  EXPECT_EQ(values.size(), 2U);  // neighbouring counts
  EXPECT_NEAR(*values.rbegin() - *values.begin(), 1e6 * kTwoPi / 1024.0 / 2e-3, 2.0);
  EXPECT_NEAR(mean, 157.0, 0.05);
}

TEST(PowerMeter, ShowsAStepAfterItsDeadTimeAndLag) {
  PowerMeter meter({.dead_time_s = 0.1, .lag_s = 0.1, .scale = 0.98, .offset_w = 5.0}, 125e-6, 1);
  double ninety_s = 0.0;
  double first_s = 0.0;
  for (int k = 0; k < 8000; ++k) {
    meter.step(1000.0);
    const double t = 125e-6 * (k + 1);
    if (first_s == 0.0 && meter.output_w() > 6.0) first_s = t;
    if (ninety_s == 0.0 && meter.output_w() > 5.0 + 0.9 * 980.0) ninety_s = t;
  }
  EXPECT_NEAR(first_s, 0.1, 0.003);
  EXPECT_NEAR(ninety_s, 0.1 + 0.1 * std::log(10.0), 0.003);  // 0.33 s
  EXPECT_NEAR(meter.output_w(), 985.0, 0.5);
}

TEST(Dynamometer, MeasuresWithGainLagAndNoise) {
  Dynamometer still({.present = true, .gain = 1.03, .offset_n = 2.0, .lag_s = 0.03}, 1e-3, 1);
  double seen = 0.0;
  for (int k = 0; k < 30; ++k) seen = still.read(500.0);
  EXPECT_NEAR(seen, 1.03 * 500.0 * (1.0 - std::exp(-1.0)) + 2.0, 1e-9);
}

TEST(SimulatedMachine, MeasuresLineToLineAndWithTwoCurrents) {
  SimulatedMachineConfig config = motor_a();
  const auto star = run_open_loop(config, 0.3);
  config.sensors.voltage_kind = VoltageKind::kLineToLine;
  config.sensors.current_w_present = false;
  const auto line = run_open_loop(config, 0.3);
  for (std::size_t k = 0; k < star.size(); ++k) {
    const auto& n = star[k].sample.voltage_v;
    const auto& l = line[k].sample.voltage_v;
    ASSERT_NEAR(l[0], n[0] - n[1], 1e-3F);
    ASSERT_NEAR(l[1], n[1] - n[2], 1e-3F);
    ASSERT_NEAR(l[2], n[2] - n[0], 1e-3F);
    ASSERT_NEAR(n[0] + n[1] + n[2], 0.0F, 1e-3F);
    ASSERT_FALSE(line[k].sample.has(Signal::kCurrentW));
    ASSERT_EQ(line[k].sample.current_a[2], 0.0F);
    ASSERT_EQ(line[k].sample.current_a[0], star[k].sample.current_a[0]);
  }
}

TEST(SimulatedMachine, LeadsTheCurrentWithTheVoltageByTheStatedTime) {
  for (const double lead_s : {62.5e-6, -40e-6}) {
    SimulatedMachineConfig config = motor_a();
    const auto aligned = run_open_loop(config, 1.5);
    config.sensors.voltage_lead_s = lead_s;
    const auto skewed = run_open_loop(config, 1.5);
    double angle = 0.0;
    int count = 0;
    for (std::size_t k = 6500; k < aligned.size(); ++k, ++count) {
      const Complex a = host_tests::voltage_of(aligned[k].sample);
      const Complex b = host_tests::voltage_of(skewed[k].sample);
      angle += cross(a, b) / squared(a);
      // Another event cuts the integration elsewhere; that is all.
      ASSERT_NEAR(aligned[k].sample.current_a[0], skewed[k].sample.current_a[0], 1e-4F);
      ASSERT_EQ(aligned[k].sample.time_ns, skewed[k].sample.time_ns);
    }
    EXPECT_NEAR(angle / count, 314.8 * lead_s, 2e-2 * 314.8 * std::abs(lead_s));
  }
}

SimulatedMachineConfig with_fault(const SignalFault& fault) {
  SimulatedMachineConfig config = motor_a();
  config.faults = {fault};
  return config;
}

TEST(SignalFaults, HarmOnlyTheirChannelAndOnlyInTheirTime) {
  const auto clean = run_open_loop(motor_a(), 0.3);
  const auto check = [&](const SignalFault& fault, auto expected) {
    const auto harmed = run_open_loop(with_fault(fault), 0.3);
    ASSERT_EQ(harmed.size(), clean.size());
    for (std::size_t k = 0; k < clean.size(); ++k) {
      const double t = clean[k].time_s();
      const bool inside = t >= 0.1 && t < 0.2;
      ASSERT_EQ(harmed[k].sample.current_a[0],
                inside ? expected(clean[k].sample) : clean[k].sample.current_a[0])
          << t;
      ASSERT_EQ(harmed[k].sample.voltage_v, clean[k].sample.voltage_v);
      ASSERT_EQ(harmed[k].truth.airgap_torque_nm, clean[k].truth.airgap_torque_nm);
    }
  };
  const float last = clean[499].sample.current_a[0];
  SignalFault fault{.kind = SignalFaultKind::kStuck,
                    .begin_s = 0.1,
                    .end_s = 0.2,
                    .channel = Signal::kCurrentU,
                    .other = Signal::kCurrentV};
  check(fault, [&](const Sample&) { return last; });
  fault.kind = SignalFaultKind::kLost;
  check(fault, [](const Sample&) { return 0.0F; });
  fault.kind = SignalFaultKind::kInverted;
  check(fault, [](const Sample& s) { return -s.current_a[0]; });
  fault.kind = SignalFaultKind::kSwapped;
  check(fault, [](const Sample& s) { return s.current_a[1]; });
}

TEST(SignalFaults, DropSamplesInAGapAndChannelsThatAreAbsent) {
  const auto gap = run_open_loop(
      with_fault({.kind = SignalFaultKind::kGap, .begin_s = 0.1, .end_s = 0.15}), 0.3);
  EXPECT_EQ(gap.size(), 1501U - 250U);
  EXPECT_EQ(gap[500].sample.time_ns, 150'000'000);

  const auto absent = run_open_loop(
      with_fault({.kind = SignalFaultKind::kAbsent, .begin_s = 0.1, .channel = Signal::kSpeed}),
      0.3);
  EXPECT_TRUE(absent[499].sample.has(Signal::kSpeed));
  EXPECT_FALSE(absent[500].sample.has(Signal::kSpeed));
}

TEST(SimulatedMachineConfig, PassesItsOwnPresets) {
  EXPECT_TRUE(default_lathe().check());
  EXPECT_TRUE(motor_a().check());
  EXPECT_TRUE(motor_b().check());
}

TEST(SimulatedMachineConfig, RefusesWhatCannotBeAndNamesTheKey) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  struct Case {
    const char* key;
    void (*spoil)(SimulatedMachineConfig&);
  };
  const std::array cases{
      Case{"sample_rate_hz", [](auto& c) { c.sample_rate_hz = 0.0; }},
      Case{"sample_rate_hz", [](auto& c) { c.sample_rate_hz = kNan; }},
      Case{"integration_step_s", [](auto& c) { c.integration_step_s = 1.0; }},
      Case{"motor.pole_pairs", [](auto& c) { c.motor.pole_pairs = 0.0; }},
      Case{"motor.pole_pairs", [](auto& c) { c.motor.pole_pairs = 2.5; }},
      Case{"motor.stator_resistance_ohm", [](auto& c) { c.motor.stator_resistance_ohm = -1.0; }},
      Case{"motor.leakage_inductance_h", [](auto& c) { c.motor.leakage_inductance_h = kNan; }},
      Case{"motor.saturation_exponent", [](auto& c) { c.motor.saturation_exponent = 0.0; }},
      Case{"inverter.dc_link_v", [](auto& c) { c.inverter.dc_link_v = 0.0; }},
      Case{"inverter.dead_time_s", [](auto& c) { c.inverter.dead_time_s = 1e-3; }},
      Case{"inverter.anti_alias_hz", [](auto& c) { c.inverter.anti_alias_hz = 500.0; }},
      Case{"drive.period_s", [](auto& c) { c.drive.period_s = 0.0; }},
      Case{"drive.current_bandwidth_rad_s", [](auto& c) { c.drive.current_bandwidth_rad_s = 1e5; }},
      Case{"drive.speed_reference_rad_s", [](auto& c) { c.drive.speed_reference_rad_s = {}; }},
      Case{"drive.speed_reference_rad_s",
           [](auto& c) {
             c.drive.speed_reference_rad_s = Profile{{1.0, 0.0}, {0.5, 10.0}};
           }},
      Case{"spindle.inertia_kg_m2", [](auto& c) { c.spindle.inertia_kg_m2 = -0.1; }},
      Case{"spindle.gear_ratio", [](auto& c) { c.spindle.gear_ratio = 0.0; }},
      Case{"process.depth_m", [](auto& c) { c.process.depth_m = Profile{-1e-3}; }},
      Case{"process.diameter_m", [](auto& c) { c.process.diameter_m = Profile{0.0}; }},
      Case{"process.hard_spots",
           [](auto& c) {
             c.process.hard_spots = {{0.2, 0.1, 2.0}};
           }},
      Case{"feed.feed_m_s", [](auto& c) { c.feed.feed_m_s = 1e-3; }},
      Case{"feed.initial_override_pct", [](auto& c) { c.feed.initial_override_pct = 255.0; }},
      Case{"load.oscillations",
           [](auto& c) {
             c.load.oscillations = {{2.0, 1.0, 1.0, 15.0}};
           }},
      Case{"sensors.voltage[1]", [](auto& c) { c.sensors.voltage[1].bits = 12.0; }},
      Case{"sensors.current[0]", [](auto& c) { c.sensors.current[0].noise = -1.0; }},
      Case{"sensors.voltage_lead_s", [](auto& c) { c.sensors.voltage_lead_s = 1e-3; }},
      Case{"faults", [](auto& c) { c.faults = {{.kind = SignalFaultKind::kGap}}; }},
  };
  for (const Case& each : cases) {
    SimulatedMachineConfig config = default_lathe();
    each.spoil(config);
    const auto machine = SimulatedMachine::make(config);
    ASSERT_FALSE(machine) << each.key;
    EXPECT_EQ(machine.error().where, each.key);
    EXPECT_FALSE(machine.error().what.empty());
    EXPECT_FALSE(machine.error().remedy.empty());
  }
}

}  // namespace
}  // namespace cutforce
