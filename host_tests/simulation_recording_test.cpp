// The simulated machine against an independent simulator's recordings of the same motor on the
// same load: two people's code, one physics. Skipped where the shared recordings are absent.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "hal/host/simulation/arithmetic.hpp"
#include "support/simulation_support.hpp"

namespace cutforce {
namespace {

using namespace hal::host;  // NOLINT: the whole file is about it
using host_tests::Columns;
using host_tests::Row;

// Means over a window, the same way from a recording and from the machine.
struct Means {
  double airgap_nm = 0.0;
  double load_nm = 0.0;
  double cutting_nm = 0.0;
  double speed_rad_s = 0.0;
  double current_a = 0.0;  // amplitude
  double voltage_v = 0.0;
  double power_w = 0.0;  // v i
  double meter_w = 0.0;
  double slip_rad_s = 0.0;  // electrical, from the angle of the current
  int count = 0;
};

struct Instant {
  double t, airgap, load, cutting, speed, meter;
  Complex v, i;
};

Instant instant_of(const Columns& c, std::size_t k) {
  const auto at = [&](const char* name) { return c.find(name)->second[k]; };
  return {at("t_s"),
          at("true_airgap_torque_nm"),
          at("true_load_torque_nm"),
          at("true_cutting_torque_nm"),
          at("speed_rad_s"),
          at("power_meter_w"),
          from_phases({at("v_un_v"), at("v_vn_v"), at("v_wn_v")}),
          from_phases({at("i_u_a"), at("i_v_a"), at("i_w_a")})};
}
Instant instant_of(const Row& r) {
  return {r.time_s(),
          r.truth.airgap_torque_nm,
          r.truth.load_torque_nm,
          r.truth.cutting_torque_nm,
          r.truth.speed_rad_s,
          static_cast<double>(r.sample.power_meter_w),
          host_tests::voltage_of(r.sample),
          host_tests::current_of(r.sample)};
}

template <class At>
Means means_of(std::size_t size, double begin_s, double end_s, At at) {
  Means m;
  double angle = 0.0;
  double first_s = 0.0;
  double last_s = 0.0;
  Complex before{};
  for (std::size_t k = 0; k < size; ++k) {
    const Instant now = at(k);
    if (now.t < begin_s - 1e-9 || now.t >= end_s - 1e-9) continue;
    m.airgap_nm += now.airgap;
    m.load_nm += now.load;
    m.cutting_nm += now.cutting;
    m.speed_rad_s += now.speed;
    m.current_a += magnitude(now.i);
    m.voltage_v += magnitude(now.v);
    m.power_w += 1.5 * dot(now.v, now.i);
    m.meter_w += now.meter;
    if (m.count++ == 0)
      first_s = now.t;
    else
      angle += std::atan2(cross(before, now.i), dot(before, now.i));
    before = now.i;
    last_s = now.t;
  }
  for (double* x : {&m.airgap_nm, &m.load_nm, &m.cutting_nm, &m.speed_rad_s, &m.current_a,
                    &m.voltage_v, &m.power_w, &m.meter_w}) {
    *x /= m.count;
  }
  m.slip_rad_s = angle / (last_s - first_s) - 2.0 * m.speed_rad_s;
  return m;
}

struct Tolerance {
  double torque_nm;
  double current_ratio;
  double voltage_ratio;
  double power_ratio;
  double slip_rad_s;
};

// Tolerances of one percent and less: the drives' observers differ, the motor may not.
constexpr Tolerance kAveraged{.torque_nm = 0.01,
                              .current_ratio = 0.003,
                              .voltage_ratio = 0.001,
                              .power_ratio = 0.005,
                              .slip_rad_s = 0.03};

void compare(const std::string& name, const SimulatedMachineConfig& config,
             const std::vector<double>& window_begin_s, const Tolerance& tolerance) {
  const auto columns = host_tests::shared_recording("induction_motor_sim/" + name + ".csv.gz");
  if (!columns) GTEST_SKIP() << "shared recording " << name << " is not here";
  const auto rows = host_tests::run_open_loop(config, window_begin_s.back() + 0.2);
  const std::size_t size = columns->find("t_s")->second.size();
  for (const double begin_s : window_begin_s) {
    SCOPED_TRACE(testing::Message() << name << " from " << begin_s << " s");
    const Means theirs = means_of(size, begin_s, begin_s + 0.1,
                                  [&](std::size_t k) { return instant_of(*columns, k); });
    const Means ours = means_of(rows.size(), begin_s, begin_s + 0.1,
                                [&](std::size_t k) { return instant_of(rows[k]); });
    ASSERT_EQ(ours.count, theirs.count);
    EXPECT_NEAR(ours.airgap_nm, theirs.airgap_nm, tolerance.torque_nm);
    EXPECT_NEAR(ours.load_nm, theirs.load_nm, tolerance.torque_nm);
    EXPECT_NEAR(ours.cutting_nm, theirs.cutting_nm, 1e-3);
    EXPECT_NEAR(ours.speed_rad_s, theirs.speed_rad_s, 0.02);
    EXPECT_NEAR(ours.current_a / theirs.current_a, 1.0, tolerance.current_ratio);
    EXPECT_NEAR(ours.voltage_v / theirs.voltage_v, 1.0, tolerance.voltage_ratio);
    EXPECT_NEAR(ours.power_w / theirs.power_w, 1.0, tolerance.power_ratio);
    EXPECT_NEAR(ours.slip_rad_s, theirs.slip_rad_s, tolerance.slip_rad_s);
    EXPECT_NEAR(ours.meter_w, theirs.meter_w, 0.01 * theirs.meter_w + 3.0);
  }
}

SimulatedMachineConfig entry_step_exit() {
  SimulatedMachineConfig config = motor_a();
  config.load.torque_nm = ramped_steps(0.0, {{2.0, 5.84}, {3.0, 8.76}, {4.0, 0.0}}, 0.03);
  return config;
}

TEST(SharedRecording, EntryStepAndExitAreReproducedAtEveryRate) {
  for (const auto& [name, rate_hz] :
       {std::pair{"c01_avg_1k", 1e3}, {"c01_avg_5k", 5e3}, {"c01_avg_20k", 2e4}}) {
    SimulatedMachineConfig config = entry_step_exit();
    config.sample_rate_hz = rate_hz;
    compare(name, config, {1.7, 2.8, 3.8, 4.45}, kAveraged);
    if (testing::Test::IsSkipped()) return;
  }
}

TEST(SharedRecording, LoadStepsToOnePointTwoOfRatedAreReproduced) {
  SimulatedMachineConfig config = motor_a();
  config.load.torque_nm = ramped_steps(
      0.0,
      {{1.4, 1.46}, {2.0, 3.65}, {2.6, 7.3}, {3.2, 10.95}, {3.8, 14.6}, {4.4, 17.52}, {5.0, 0.0}},
      0.02);
  compare("c03_avg_5k", config, {1.3, 1.9, 2.5, 3.1, 3.7, 4.3, 4.9}, kAveraged);
}

TEST(SharedRecording, VoltsPerHertzInOvermodulationIsReproduced) {
  SimulatedMachineConfig config = motor_a();
  config.load.torque_nm = ramped_steps(0.0, {{2.2, 5.84}, {3.2, 8.76}, {4.2, 0.0}}, 0.03);
  config.drive.control = DriveControl::kVoltsPerHertz;
  constexpr double kRampS = 157.0796 / (kPi * 60.0);
  config.drive.speed_reference_rad_s = Profile{{0.0, 0.0}, {0.15, 0.0}, {0.15 + kRampS, 157.0796}};
  Tolerance tolerance = kAveraged;
  // The fifth and seventh harmonic shake the ends of the window: 0.03 rad over 0.1 s each.
  tolerance.slip_rad_s = 0.5;
  compare("c06_avg_5k", config, {1.7, 3.0, 4.0}, tolerance);
}

TEST(SharedRecording, SpeedStaircaseIsReproduced) {
  SimulatedMachineConfig config = motor_a();
  std::vector<ProfilePoint> stairs;
  for (int k = 0; k < 5; ++k) {
    stairs.push_back({0.2 + 0.8 * k, 10.0 * kPi * k});
    stairs.push_back({0.45 + 0.8 * k, 10.0 * kPi * (k + 1)});
  }
  config.drive.speed_reference_rad_s = Profile{stairs};
  config.sample_rate_hz = 1000.0;
  compare("c02_avg_1k", config, {0.88, 1.68, 2.48, 3.28, 4.08}, kAveraged);
}

TEST(SharedRecording, VoltageThatLeadsByHalfAHoldIsReproduced) {
  SimulatedMachineConfig config = entry_step_exit();
  config.sample_rate_hz = 1000.0;
  config.sensors.voltage_signal = VoltageSignal::kReference;
  compare("c01_skew_1k", config, {1.7, 2.8, 3.8}, kAveraged);
}

TEST(SharedRecording, SwitchingBehindAntiAliasFiltersIsReproduced) {
  SimulatedMachineConfig config = motor_a();
  config.load.torque_nm = ramped_steps(0.0, {{1.4, 5.84}, {2.0, 8.76}, {2.6, 0.0}}, 0.03);
  config.inverter.switched = true;
  config.inverter.anti_alias_hz = 1600.0;
  config.sensors.voltage_signal = VoltageSignal::kInstantaneous;
  config.drive.speed_reference_rad_s = Profile{{0.0, 0.0}, {0.15, 0.0}, {0.65, 157.0796}};
  Tolerance tolerance = kAveraged;
  tolerance.power_ratio = 0.01;  // at idle 1 W of 174 W: what ripple 5 kHz folds into v i
  tolerance.slip_rad_s = 0.2;    // ripple at the ends of the window
  compare("c11_pwmaa_5k", config, {1.2, 1.9, 2.5}, tolerance);
}

}  // namespace
}  // namespace cutforce
