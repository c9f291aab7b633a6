// Voltages and currents of different instants, from the simulated sensors to the torque.
#include <gtest/gtest.h>

#include <optional>

#include "firmware/configuration.hpp"
#include "firmware/parameter_table.hpp"
#include "firmware/rating.hpp"
#include "hal/host/simulation/simulated_machine.hpp"

namespace cutforce::host_tests {
namespace {

using firmware::LoopOutput;

// Mean cutting torque of the second half of a cut of 5.84 N m, told that the voltages lead.
float torque_in_the_cut(float told_s) {
  auto config = hal::host::motor_a();
  config.load.torque_nm = hal::host::ramped_steps(0.0, {{2.0, 5.84}}, 0.03);
  config.sensors.voltage_lead_s = 62.5e-6;
  config.sensors.feed_active_present = false;  // a plain load: no feed to tell of
  auto plant = hal::host::SimulatedMachine::make(config).value();

  firmware::Machine machine = firmware::unspecified_machine();
  machine.pole_pairs = 2.0F;
  machine.stator_resistance_ohm = 3.7F;
  machine.rated_power_w = 2200.0F;
  machine.rated_torque_nm = 14.6F;
  machine.rated_current_a_rms = 5.0F;
  machine.inertia_kg_m2 = 0.03F;
  machine.coulomb_torque_nm = 0.4F;
  machine.viscous_nm_s_rad = 0.002F;
  machine.load_friction_ratio = {0.05F, 0.05F, 0.05F};
  machine.speed_present = true;
  machine.current_w_present = true;
  machine.sample_rate_hz = 5000.0F;
  machine.voltage_lead_s = told_s;
  auto loop = firmware::make_loop(firmware::complete_from_rating(machine).value()).value();

  float sum = 0.0F;
  int rows = 0;
  for (auto sample = plant.advance(); sample.time_ns <= 3'000'000'000; sample = plant.advance()) {
    const auto out = loop.step(sample);
    if (!out || out->time_ns < 2'500'000'000) continue;
    EXPECT_NE(out->present & LoopOutput::kCuttingTorque, 0U);
    sum += out->cutting_torque_nm;
    ++rows;
  }
  return sum / static_cast<float>(rows);
}

TEST(VoltageLead, CostsTorqueAndIsTakenOutByItsParameter) {
  EXPECT_GT(torque_in_the_cut(0.0F), 5.84F + 0.05F);
  EXPECT_NEAR(torque_in_the_cut(62.5e-6F), 5.84F, 0.015F);
}

}  // namespace
}  // namespace cutforce::host_tests
