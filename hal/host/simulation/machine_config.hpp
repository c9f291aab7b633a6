// Everything that a simulated machine is, in SI units; the parts are described beside their blocks.
// Start from default_lathe(), motor_a() or motor_b() and change what the scenario changes.
#pragma once

#include <cstdint>
#include <expected>
#include <vector>

#include "hal/host/input_error.hpp"
#include "hal/host/simulation/cutting_process.hpp"
#include "hal/host/simulation/drive.hpp"
#include "hal/host/simulation/feed_servo.hpp"
#include "hal/host/simulation/induction_motor.hpp"
#include "hal/host/simulation/inverter.hpp"
#include "hal/host/simulation/plant.hpp"
#include "hal/host/simulation/profile.hpp"
#include "hal/host/simulation/sensors.hpp"
#include "hal/host/simulation/signal_fault.hpp"

namespace cutforce::hal::host {

struct SimulatedMachineConfig {
  std::uint64_t seed = 1;
  double sample_rate_hz;
  double integration_step_s = 200e-6;  // the longest; events cut it shorter
  MotorConfig motor;
  InverterConfig inverter;
  DriveConfig drive;
  SpindleConfig spindle;
  Profile friction_ratio{1.0};  // of Coulomb and viscous friction, over time: warming up
  LoadFrictionConfig load_friction{};
  ProcessConfig process{};
  LoadConfig load{};
  FeedConfig feed{};
  SensorConfig sensors{};
  std::vector<SignalFault> faults{};

  // Fails iff a value is not finite, out of its range, or contradicts another; `where` of the
  // error is the key ("motor.rotor_resistance_ohm"), to which a caller adds its file.
  [[nodiscard]] std::expected<void, InputError> check() const;
};

// 5.5 kW lathe of the reproduction of P3: 200 V delta motor (values here star-equivalent),
// 1000 rpm, 1:1, 50 mm, k_s 2000 N/mm^2, 0.2 mm/turn; depth 0 -> 1 -> 1.5 -> 0 mm over the path.
[[nodiscard]] SimulatedMachineConfig default_lathe();
// 2.2 kW, 400 V star, saturated; 1500 rpm vector drive, no load. The motor of Hinkkanen's group,
// whose values are printed beside the simulated recordings of the project's test data.
[[nodiscard]] SimulatedMachineConfig motor_a();
// 7.5 kW, 400 V star: rated slip 3.3 %, power factor 0.84 and 0.17 p.u. leakage of its class.
[[nodiscard]] SimulatedMachineConfig motor_b();

}  // namespace cutforce::hal::host
