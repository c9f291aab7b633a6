#include "estimator/torque_path.hpp"

namespace cutforce::estimator {

bool TorquePath::add_motor(std::span<const MotorSample> motor) noexcept {
  const bool power_ends = blocks_.power.add_run(motor, sums_.electrical_rad_s);
  return blocks_.synchronous.add_run(motor) && power_ends;
}

bool TorquePath::add(const Input& input) noexcept {
  const MotorSample motor = input.motor_valid ? input.motor : MotorSample{};
  add_speed(input.speed_valid ? input.speed_rad_s : 0.0F);
  if (input.meter_valid) {
    sums_.meter_w += input.power_meter_w;
    ++sums_.meter_samples;
  }
  if (input.motor_valid) ++sums_.motor_samples;
  if (input.speed_valid) ++sums_.speed_samples;
  return add_motor({&motor, 1});
}

void TorquePath::restart() noexcept {
  blocks_.power.restart();
  blocks_.synchronous.restart();
  blocks_.drive.restart();
  sums_ = {.idle_current_square_a2 = sums_.idle_current_square_a2};
}

auto TorquePath::state() const noexcept -> State {
  return {.power = blocks_.power.state(),
          .synchronous = blocks_.synchronous.state(),
          .meter = blocks_.meter.state(),
          .drive = blocks_.drive.state(),
          .tare = blocks_.tare.state(),
          .monitor = blocks_.monitor.state(),
          .sums = sums_};
}

void TorquePath::restore(const State& state) noexcept {
  blocks_.power.restore(state.power);
  blocks_.synchronous.restore(state.synchronous);
  blocks_.meter.restore(state.meter);
  blocks_.drive.restore(state.drive);
  blocks_.tare.restore(state.tare);
  blocks_.monitor.restore(state.monitor);
  sums_ = state.sums;
}

}  // namespace cutforce::estimator
