#include "estimator/torque_path.hpp"

#include <cmath>

#include "estimator/torque_path_parts.hpp"

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

auto TorquePath::close_window(Feed feed) noexcept -> Output {
  const AirGapPower::Output power = blocks_.power.close_window();
  const SynchronousSpeed::Output synchronous = blocks_.synchronous.close_window();
  const Window means = window(power, synchronous);
  sums_.electrical_rad_s = synchronous.valid ? synchronous.electrical_rad_s : 0.0F;
  Output output{};
  output.airgap_power_valid = means.has_airgap_power;
  output.measured_power_valid = means.has_measured_power;
  output.speed_valid = means.has_speed;
  output.airgap_power_w = means.has_airgap_power ? means.airgap_power_w : 0.0F;
  output.measured_power_w = means.has_measured_power ? means.measured_power_w : 0.0F;
  output.speed_rad_s = means.direction * means.speed_rad_s;
  output.synchronous_rad_s =
      means.has_airgap_power && synchronous.valid ? synchronous.synchronous_rad_s : 0.0F;
  estimate_torque(means, feed, output);

  sums_.speed_rad_s = 0.0F;
  sums_.meter_w = 0.0F;
  sums_.motor_samples = 0;
  sums_.speed_samples = 0;
  sums_.meter_samples = 0;
  return output;
}

void TorquePath::estimate_torque(const Window& window, Feed feed, Output& output) noexcept {
  Estimate from_computed = computed(window);
  Estimate from_measured = measured(window);
  const float leading_nm =
      window.has_airgap_power ? from_computed.airgap_torque_nm : from_measured.airgap_torque_nm;
  const Load load = follow_load(window, leading_nm, feed);
  for (Estimate* estimate : {&from_computed, &from_measured}) {
    const auto cutting =
        blocks_.friction.step({.torque_nm = estimate->airgap_torque_nm - load.not_cutting_nm,
                               .speed_rad_s = window.speed_rad_s});
    estimate->cutting_torque_nm = cutting.cutting_torque_nm;
    estimate->sensitivity_ratio = cutting.sensitivity_ratio;
  }
  output.in_cut = load.tare.in_cut;
  output.tared = load.tare.acquired;
  output.tare_age_s = load.tare.age_s;
  output.idle_torque_nm = window.direction * load.tare.idle_torque_nm;
  output.idle_torque_sigma_nm = load.tare.sigma_nm;

  const Estimate chosen = choose(window, from_computed, from_measured, output.origin);
  const bool turning = window.has_speed && window.speed_rad_s >= config_.minimum_speed_rad_s &&
                       window.power_speed_rad_s >= config_.minimum_speed_rad_s;
  if (!turning || output.origin == Origin::kNone) {
    output.origin = Origin::kNone;
    sums_.has_torque = 0;
    return;
  }
  publish(window, load, chosen, output);
}

auto TorquePath::follow_load(const Window& window, float airgap_torque_nm, Feed feed) noexcept
    -> Load {
  if (!window.has_speed) blocks_.drive.restart();
  const float viscous = blocks_.tare.state().viscous_nm_s_rad;
  const auto driven = blocks_.drive.step({.airgap_torque_nm = airgap_torque_nm,
                                          .speed_rad_s = window.end_speed_rad_s,
                                          .viscous_nm_s_rad = viscous});
  const bool has_power = window.has_airgap_power || window.has_measured_power;
  const auto tare = blocks_.tare.step({.load_torque_nm = driven.load_torque_nm,
                                       .inertia_torque_nm = driven.inertia_torque_nm,
                                       .speed_rad_s = window.speed_rad_s,
                                       .feed = feed,
                                       .valid = has_power && window.has_speed});
  if (tare.taring && window.has_airgap_power) {
    sums_.idle_current_square_a2 = window.current_square_a2;
    if (window.has_measured_power) blocks_.meter.calibrate(window.airgap_power_w);
  }
  // The tare may have changed B since the drive model used it.
  const float changed_nm = (tare.viscous_nm_s_rad - viscous) * window.speed_rad_s;
  return {.tare = tare,
          .inertia_torque_nm = driven.inertia_torque_nm,
          .not_cutting_nm =
              airgap_torque_nm - driven.external_torque_nm + tare.coulomb_nm + changed_nm};
}

void TorquePath::publish(const Window& window, const Load& load, const Estimate& chosen,
                         Output& output) noexcept {
  output.torque_valid = true;
  output.airgap_torque_nm = window.direction * chosen.airgap_torque_nm;
  output.load_torque_nm = window.direction * (chosen.airgap_torque_nm - load.inertia_torque_nm);
  output.cutting_torque_nm = window.direction * chosen.cutting_torque_nm;
  const float motion =
      sums_.has_torque != 0 ? 0.5F * (chosen.cutting_torque_nm - sums_.cutting_torque_nm) : 0.0F;
  sums_.cutting_torque_nm = chosen.cutting_torque_nm;
  sums_.has_torque = 1;
  const float variance =
      chosen.sensitivity_ratio * chosen.sensitivity_ratio * torque_variance(window, load, chosen);
  output.cutting_torque_sigma_nm = std::sqrt(variance + motion * motion);  // (E48)
}

auto TorquePath::choose(const Window& window, const Estimate& computed, const Estimate& measured,
                        Origin& origin) noexcept -> Estimate {
  bool use_computed = config_.method != Method::kMeasured && window.has_airgap_power;
  float factor = 1.0F;
  if (window.has_airgap_power && window.has_measured_power) {
    const auto decided = blocks_.monitor.step({.computed_power_w = window.airgap_power_w,
                                               .measured_power_w = window.measured_power_w,
                                               .computed_torque_nm = computed.cutting_torque_nm,
                                               .measured_torque_nm = measured.cutting_torque_nm});
    if (config_.method == Method::kSynthesized) {
      use_computed = decided.computed;
      factor = decided.factor_ratio;
    }
  }
  const bool use_measured = config_.method != Method::kComputed && window.has_measured_power;
  origin = use_computed ? Origin::kComputed : use_measured ? Origin::kMeasured : Origin::kNone;
  Estimate chosen = use_computed ? computed : measured;
  chosen.cutting_torque_nm *= factor;
  chosen.sensitivity_ratio *= factor;
  return chosen;
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
