// A machine tool that exists only here: motor, inverter, drive, spindle, cut, feed and sensors,
// stepped from event to event (control of the drive, switching edges, sampling) in whole
// nanoseconds, so that nothing depends on rounding and one seed gives one recording, bit for bit,
// on every machine with IEEE doubles. Equations (S1)-(S39): hal/host/EQUATIONS.md.
//
// It is a value: a copy goes on exactly as the original would. advance() allocates nothing.
// Truth is for scoring and has its own way out; hal::Sample carries only what sensors see.
#pragma once

#include <array>
#include <cstdint>
#include <expected>

#include "hal/host/input_error.hpp"
#include "hal/host/simulation/machine_config.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::host {

struct MachineTruth {
  std::int64_t time_ns;
  double airgap_torque_nm;
  double load_torque_nm;     // all that loads the motor: cut, friction; not inertia
  double cutting_torque_nm;  // at the motor
  double cutting_force_n;
  double speed_rad_s;  // motor shaft
  double feed_m_s;
  double depth_m;
  double position_m;
  double diameter_m;
  double override_pct;   // in effect
  double input_power_w;  // into the motor, mean of the last hold
  double stator_resistance_ohm;
  double slip_speed_rad_s;  // electrical: rotor flux against rotor
};

class SimulatedMachine {
 public:
  // Fails as check() of the config does.
  [[nodiscard]] static std::expected<SimulatedMachine, InputError> make(
      const SimulatedMachineConfig& config);

  // Runs to the next sample that is delivered and returns it; the first is at time 0.
  Sample advance() noexcept;
  // What the feed servo's PLC finds on the wire from now on.
  void set_override(double percent) noexcept { feed_.set_override(percent); }

  // Of the sample that advance() returned last.
  [[nodiscard]] const MachineTruth& truth() const noexcept { return truth_; }
  [[nodiscard]] std::int64_t now_ns() const noexcept { return now_ns_; }
  [[nodiscard]] const SimulatedMachineConfig& config() const noexcept { return config_; }

 private:
  struct Hold {
    std::array<double, 3> duty{0.5, 0.5, 0.5};
    Complex reference_v;  // after the limits
    Complex mean_v;       // with dead time and drops
  };

  explicit SimulatedMachine(const SimulatedMachineConfig& config);

  void run_to(std::int64_t time_ns) noexcept;
  void control() noexcept;
  void step_cut(double time_s) noexcept;
  [[nodiscard]] Complex voltage_signal() const noexcept;
  void read_voltages() noexcept;
  void read_currents_and_rest() noexcept;
  void note_truth(const MotorInstant& at) noexcept;
  [[nodiscard]] std::int64_t sample_time_ns(std::int64_t index) const noexcept;

  SimulatedMachineConfig config_;
  std::int64_t hold_ns_;
  double hold_s_;
  double sample_s_;
  double longest_step_s_;
  std::int64_t voltage_lead_ns_;

  Plant plant_;
  PlantState state_{};
  PlantInput input_{};
  Inverter inverter_;
  Drive drive_;
  FeedServo feed_;
  CuttingProcess process_;
  ProfileCursor friction_{};
  std::array<Channel, 3> voltage_channel_;
  std::array<Channel, 3> current_channel_;
  SpeedSensor speed_sensor_;
  PowerMeter power_meter_;
  Dynamometer dynamometer_;
  SignalFaults faults_;
  std::uint32_t present_;

  Hold before_{}, hold_{}, after_{};
  double energy_j_ = 0.0;  // into the motor since the hold began
  double power_w_ = 0.0;
  std::int64_t now_ns_ = 0;
  std::int64_t hold_begin_ns_ = 0;
  std::int64_t next_control_ns_ = 0;
  std::int64_t index_ = 0;  // of the sample in the making
  bool has_voltages_ = false;
  bool has_rest_ = false;
  Sample sample_{};
  MachineTruth truth_{};
};

}  // namespace cutforce::hal::host
