#include "estimator/torque_path.hpp"

namespace cutforce::estimator {
auto TorquePath::make(const Config& config) noexcept -> std::expected<TorquePath, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return TorquePath{config};
}

TorquePath::TorquePath(const Config& config) noexcept
    : settings_{.method = config.method,
                .speed = config.speed,
                .samples_per_window = config.power.samples_per_window,
                .count = static_cast<float>(config.power.samples_per_window),
                .pole_pairs = config.synchronous.pole_pairs,
                .slip_ohm = 1.5F * config.synchronous.pole_pairs * config.synchronous.pole_pairs,
                .loss_sigma_ohm = 1.5F * config.power.stator_resistance_ohm *
                                  config.stator_resistance_sigma_ratio,
                .speed_variance_nm2 = 0.0F,
                .rotor_resistance_ohm = config.rotor_resistance_ohm,
                .rated_torque_nm = config.rated_torque_nm,
                .rated_slip_ratio = config.rated_slip_ratio,
                .inertia_sigma_ratio = config.inertia_sigma_ratio,
                .minimum_speed_rad_s = config.minimum_speed_rad_s},
      blocks_{.power = *AirGapPower::make(config.power),
              .synchronous = *SynchronousSpeed::make(config.synchronous),
              .meter = *MeasuredPower::make(config.meter),
              .drive = *DriveModel::make(config.drive),
              .friction = *LoadFriction::make(config.load_friction),
              .tare = *IdleTare::make(config.tare),
              .monitor = *SynthesizedMonitor::make(config.monitor)} {
  const float speed_nm = blocks_.drive.gain(0.0F) * config.speed_sigma_rad_s;
  settings_.speed_variance_nm2 = 2.0F * speed_nm * speed_nm;
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
