// A control tick of the estimator `synthesized` and the law `pi`, as control loop and board run it:
// torque of the window that ends, cutting force, override, supervisor, guarded frame. The raw
// samples of the window are not part of it. Each step can be counted alone too.
#pragma once

#include <cstdint>

#include "control/control_path.hpp"
#include "control/supervisor.hpp"
#include "estimator/cutting_force.hpp"
#include "estimator/front_end.hpp"
#include "estimator/sample_gate.hpp"
#include "estimator/torque_path.hpp"
#include "firmware/control_loop.hpp"
#include "hal/can/messages.hpp"
#include "hal/port.hpp"
#include "host_tests/benchmarks/target_bodies.hpp"
#include "host_tests/support/sound_input.hpp"

namespace cutforce::benchmarks {

class SynthesizedTick {
 public:
  SynthesizedTick(const firmware::ControlLoop::Config& config,
                  const control::Supervisor::Config& supervisor)
      : diameter_m_(config.fixed_diameter_m),
        cutting_force_(*estimator::CuttingForce::make(config.force)),
        supervisor_(*control::Supervisor::make(supervisor)),
        controller_(control::ControlPath::make_checked(config.controller)),
        path_(estimator::TorquePath::make_checked(config.path)),
        gate_(*estimator::SampleGate::make(config.gate)),
        front_end_(*estimator::FrontEnd::make(config.front_end)) {
    take_control();
  }

  // True with the last sample of a window; a tick is due then.
  [[nodiscard]] bool add(const hal::Sample& sample) noexcept {
    keep(gate_.step(gated(sample)));
    const auto& values = gate_.values();
    return path_.add({.motor = front_end_.step({values.voltage_v, values.current_a}).motor,
                      .speed_rad_s = values.speed_rad_s,
                      .power_meter_w = values.power_w,
                      .motor_valid = true,
                      .speed_valid = true,
                      .meter_valid = true,
                      .feed = estimator::Feed::kUnknown});
  }

  void close_window() noexcept { path_.close_window(estimator::Feed::kUnknown, torque_); }
  void find_force() noexcept {
    force_ = cutting_force_.step({.cutting_torque_nm = torque_.cutting_torque_nm,
                                  .cutting_torque_sigma_nm = torque_.cutting_torque_sigma_nm,
                                  .speed_rad_s = torque_.speed_rad_s,
                                  .diameter_m = diameter_m_});
  }
  // What the loop keeps of it: the command, the limits, what the law knows.
  void control() noexcept {
    const auto controlled =
        controller_.step({.force_n = force_.force_n,
                          .force_sigma_n = force_.force_sigma_n,
                          .force_age_ticks = 0,
                          .override_reported_pct = static_cast<float>(supervision_.override_pct),
                          .spindle_ratio = spindle_ratio_,
                          .force_valid = has_force(),
                          .override_reported = override_reported_,
                          .permission = supervision_.permission,
                          .part_start = part_start_});
    command_.override_pct = controlled.override_pct;
    command_.override_code = controlled.override_code;
    command_.controlling = controlled.controlling;
    law_ = controlled.law;
    saturated_low_ = controlled.saturated_low;
    saturated_high_ = controlled.saturated_high;
  }
  void supervise() noexcept {
    health_.force_new = has_force();
    health_.force_n = force_.force_n;
    health_.override_pct = command_.override_pct;
    supervision_ = supervisor_.step(health_);
  }
  void pack() noexcept {
    frame_ =
        hal::can::pack(hal::can::Override{.override_pct = supervision_.override_pct,
                                          .state = static_cast<std::uint8_t>(supervision_.state),
                                          .reason = static_cast<std::uint8_t>(supervision_.reason),
                                          .force_n = force_.force_n,
                                          .enabled = supervision_.controlling,
                                          .saturated_low = saturated_low_,
                                          .saturated_high = saturated_high_,
                                          .in_cut = torque_.in_cut,
                                          .source = static_cast<std::uint8_t>(torque_.origin),
                                          .limit = false},
                       kNode, ++counter_);
  }
  void step() noexcept {
    close_window();
    find_force();
    control();
    supervise();
    pack();
  }

  [[nodiscard]] bool in_control() const noexcept { return supervision_.controlling; }

 private:
  static constexpr std::uint8_t kNode = 1;

  [[nodiscard]] bool has_force() const noexcept {
    return torque_.torque_valid && force_.status == estimator::CuttingForce::Status::kForce;
  }

  // What a CNC does: it waits until the board is ready, arms it, and gives it control.
  void take_control() noexcept {
    health_.arm = health_.control = false;
    for (int k = 0; k < 8; ++k) supervision_ = supervisor_.step(health_);
    health_.arm = true;
    for (int k = 0; k < 2; ++k) supervision_ = supervisor_.step(health_);
    health_.control = true;
    supervision_ = supervisor_.step(health_);
  }

  control::Supervisor::Input health_ = host_tests::sound_input();
  estimator::TorquePath::Output torque_{};
  estimator::CuttingForce::Output force_{};
  hal::Command command_{};
  control::LawOutput law_{};
  bool saturated_low_ = false;
  bool saturated_high_ = false;
  control::Supervisor::Output supervision_{};
  hal::can::Frame frame_{};
  std::uint8_t counter_ = 0;
  float spindle_ratio_ = 1.0F;
  bool override_reported_ = true;
  bool part_start_ = false;
  float diameter_m_;
  estimator::CuttingForce cutting_force_;
  control::Supervisor supervisor_;
  control::ControlPath controller_;
  estimator::TorquePath path_;
  estimator::SampleGate gate_;
  estimator::FrontEnd front_end_;
};

}  // namespace cutforce::benchmarks
