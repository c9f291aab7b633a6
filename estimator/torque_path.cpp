#include "estimator/torque_path.hpp"

#include <algorithm>
#include <cmath>

namespace cutforce::estimator {
namespace {

constexpr float kSmallestFluxV2s2 = 1e-6F;  // only keeps a division finite

}  // namespace

struct TorquePath::Window {
  float airgap_power_w;
  float current_square_a2;
  float noise_variance_w2;
  float measured_power_w;
  float measured_sigma_w;
  float direction;          // +1 or -1
  float speed_rad_s;        // rotor, mean
  float end_speed_rad_s;    // rotor, at the end of the window
  float power_speed_rad_s;  // that power is divided by
  bool has_airgap_power;
  bool has_measured_power;
  bool has_speed;
  bool has_sensor;
};

struct TorquePath::Estimate {
  float airgap_torque_nm;
  float cutting_torque_nm;
  float sensitivity_ratio;
  float noise_variance_nm2;  // of airgap_torque_nm, from what this estimate alone rests on
  float model_variance_nm2;
};

struct TorquePath::Load {
  IdleTare::Output tare;
  float inertia_torque_nm;
  float not_cutting_nm;  // what stands between air-gap torque and torque above idle
};

auto TorquePath::make(const Config& config) noexcept -> std::expected<TorquePath, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return TorquePath{config,
                    {.power = *AirGapPower::make(config.power),
                     .synchronous = *SynchronousSpeed::make(config.synchronous),
                     .meter = *MeasuredPower::make(config.meter),
                     .drive = *DriveModel::make(config.drive),
                     .friction = *LoadFriction::make(config.load_friction),
                     .tare = *IdleTare::make(config.tare),
                     .monitor = *SynthesizedMonitor::make(config.monitor)}};
}

auto TorquePath::step(const Input& input) noexcept -> std::optional<Output> {
  const MotorSample motor = input.motor_valid ? input.motor : MotorSample{};
  const auto power =
      blocks_.power.step({.sample = motor, .electrical_rad_s = sums_.electrical_rad_s});
  const auto synchronous = blocks_.synchronous.step(motor);

  // Trapezoid, as AirGapPower does.
  const float speed = input.speed_valid ? input.speed_rad_s : 0.0F;
  const float before = sums_.continued != 0 ? sums_.last_speed_rad_s : speed;
  sums_.continued = 1;
  sums_.last_speed_rad_s = speed;
  sums_.speed_rad_s += 0.5F * (before + speed);
  sums_.meter_w += input.meter_valid ? input.power_meter_w : 0.0F;
  sums_.motor_samples += input.motor_valid ? 1U : 0U;
  sums_.speed_samples += input.speed_valid ? 1U : 0U;
  sums_.meter_samples += input.meter_valid ? 1U : 0U;
  if (!power || !synchronous) return std::nullopt;
  return close_window(*power, *synchronous, input.feed);
}

void TorquePath::restart() noexcept {
  blocks_.power.restart();
  blocks_.synchronous.restart();
  blocks_.drive.restart();
  sums_ = {.idle_current_square_a2 = sums_.idle_current_square_a2};
}

auto TorquePath::close_window(const AirGapPower::Output& power,
                              const SynchronousSpeed::Output& synchronous, Feed feed) noexcept
    -> Output {
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

auto TorquePath::window(const AirGapPower::Output& power,
                        const SynchronousSpeed::Output& synchronous) noexcept -> Window {
  const std::uint32_t samples = config_.power.samples_per_window;
  Window means{};
  means.has_airgap_power = sums_.motor_samples == samples;
  means.airgap_power_w = power.airgap_power_w;
  means.current_square_a2 = power.current_square_a2;
  means.noise_variance_w2 = power.noise_variance_w2;
  find_speeds(synchronous, means);
  // A meter is slow: some readings of the window will do.
  means.has_measured_power = 2 * sums_.meter_samples >= samples;
  if (means.has_measured_power) {
    const auto measured =
        blocks_.meter.step({.meter_w = sums_.meter_w / static_cast<float>(sums_.meter_samples),
                            .speed_rad_s = means.speed_rad_s});
    means.measured_power_w = measured.power_w;
    means.measured_sigma_w = measured.sigma_w;
  }
  return means;
}

void TorquePath::find_speeds(const SynchronousSpeed::Output& synchronous,
                             Window& window) const noexcept {
  const float count = static_cast<float>(config_.power.samples_per_window);
  const bool has_sensor = sums_.speed_samples == config_.power.samples_per_window;
  const bool has_rotation = window.has_airgap_power && synchronous.valid;
  window.has_speed = has_sensor || has_rotation;
  window.has_sensor = has_sensor;
  const float flux_square = std::max(synchronous.flux_square_v2s2, kSmallestFluxV2s2);
  float mean = sums_.speed_rad_s / count;
  float end = sums_.last_speed_rad_s;
  float divide = mean;
  if (!has_sensor && has_rotation) {
    // (E29) the other way round.
    const float slip = config_.rotor_resistance_ohm * window.airgap_power_w /
                       (1.5F * config_.synchronous.pole_pairs * config_.synchronous.pole_pairs *
                        flux_square * synchronous.synchronous_rad_s);
    mean = synchronous.synchronous_rad_s - slip;
    end = synchronous.synchronous_end_rad_s - slip;
    divide = synchronous.synchronous_rad_s;
  } else if (has_rotation && config_.speed == Speed::kSynchronous) {
    divide = synchronous.synchronous_rad_s;
  } else if (has_rotation && config_.speed == Speed::kSlip) {
    divide = synchronous_speed_from_slip(mean, window.airgap_power_w, config_.rotor_resistance_ohm,
                                         config_.synchronous.pole_pairs, flux_square);
  }
  window.direction = mean < 0.0F ? -1.0F : 1.0F;
  window.speed_rad_s = window.has_speed ? window.direction * mean : 0.0F;
  window.end_speed_rad_s = window.direction * end;
  window.power_speed_rad_s = window.direction * divide;
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

// P3 (1) or (4), by the speed that find_speeds chose.
auto TorquePath::computed(const Window& window) const noexcept -> Estimate {
  const float speed = std::max(window.power_speed_rad_s, config_.minimum_speed_rad_s);
  const float loss = 1.5F * config_.power.stator_resistance_ohm *
                     config_.stator_resistance_sigma_ratio *
                     (window.current_square_a2 - sums_.idle_current_square_a2);
  return {.airgap_torque_nm = window.airgap_power_w / speed,
          .cutting_torque_nm = 0.0F,
          .sensitivity_ratio = 0.0F,
          .noise_variance_nm2 = window.noise_variance_w2 / (speed * speed),
          .model_variance_nm2 = loss * loss / (speed * speed)};
}

auto TorquePath::measured(const Window& window) const noexcept -> Estimate {
  const float speed = std::max(window.power_speed_rad_s, config_.minimum_speed_rad_s);
  const float sigma = window.measured_sigma_w / speed;
  return {.airgap_torque_nm = window.measured_power_w / speed,
          .cutting_torque_nm = 0.0F,
          .sensitivity_ratio = 0.0F,
          .noise_variance_nm2 = 0.0F,
          .model_variance_nm2 = sigma * sigma};
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

// Of the torque above idle: (E48) without its last term.
auto TorquePath::torque_variance(const Window& window, const Load& load,
                                 const Estimate& estimate) const noexcept -> float {
  const float speed_nm = blocks_.drive.gain(0.0F) * config_.speed_sigma_rad_s;
  const float seen = load.tare.noise_sigma_nm * load.tare.noise_sigma_nm;
  const float noise = std::max(estimate.noise_variance_nm2 + 2.0F * speed_nm * speed_nm, seen);
  const float inertia_nm = config_.inertia_sigma_ratio * load.inertia_torque_nm;
  // P3 (4) overstates the torque by the slip, which grows with the torque itself.
  const bool slip_left_out = config_.speed == Speed::kRotor && window.has_sensor;
  const float slip_nm = slip_left_out ? config_.rated_slip_ratio * estimate.airgap_torque_nm *
                                            estimate.airgap_torque_nm / config_.rated_torque_nm
                                      : 0.0F;
  return noise + estimate.model_variance_nm2 + inertia_nm * inertia_nm + slip_nm * slip_nm +
         load.tare.sigma_nm * load.tare.sigma_nm;
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
