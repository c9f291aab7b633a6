#include "firmware/control_loop.hpp"

namespace cutforce::firmware {
namespace {

using estimator::SampleGate;
using hal::Signal;

}  // namespace

ControlLoop::ControlLoop(const Config& config) noexcept
    : config_(config),
      gate_(*SampleGate::make(config.gate)),
      front_end_(*estimator::FrontEnd::make(config.front_end)),
      health_(*estimator::SignalHealth::make(config.health)),
      calibration_(*estimator::IdleCalibration::make(config.calibration)),
      fused_(*estimator::FusedObserver::make(config.fused)),
      path_(*estimator::TorquePath::make(config.path)),
      load_friction_(*estimator::LoadFriction::make(config.load_friction)),
      force_(*estimator::CuttingForce::make(config.force)),
      controller_(*control::ControlPath::make(config.controller)) {
  own_.calibration = config.front_end.calibration;
  own_.diameter_m = config.fixed_diameter_m;
  const auto neutral =
      static_cast<std::uint8_t>(config.controller.feed_override.initial_pct + 0.5F);
  command_ = {.time_ns = 0,
              .override_pct = neutral,
              .override_code = control::encode(config.controller.code, neutral),
              .controlling = false};
}

auto ControlLoop::make(const Config& config) noexcept -> std::expected<ControlLoop, ConfigError> {
  const auto fail = [](ConfigError error) { return std::unexpected{error}; };
  if (config.samples_per_estimate < 1 || config.estimates_per_control < 1) {
    return fail(ConfigError::kPeriods);
  }
  if (!config.gate.check()) return fail(ConfigError::kGate);
  if (!config.front_end.check()) return fail(ConfigError::kFrontEnd);
  if (!config.health.check()) return fail(ConfigError::kHealth);
  if (!config.calibration.check()) return fail(ConfigError::kCalibration);
  if (!config.fused.check()) return fail(ConfigError::kFused);
  if (!config.path.check()) return fail(ConfigError::kTorquePath);
  if (!config.load_friction.check()) return fail(ConfigError::kLoadFriction);
  if (!config.force.check()) return fail(ConfigError::kCuttingForce);
  if (!config.controller.check()) return fail(ConfigError::kControl);
  return ControlLoop{config};
}

auto ControlLoop::state() const noexcept -> State {
  return {.gate = gate_.state(),
          .front_end = front_end_.state(),
          .health = health_.state(),
          .calibration = calibration_.state(),
          .fused = fused_.state(),
          .path = path_.state(),
          .controller = controller_.state(),
          .own = own_,
          .command = command_};
}

void ControlLoop::restore(const State& state) noexcept {
  gate_.restore(state.gate);
  front_end_.restore(state.front_end);
  health_.restore(state.health);
  calibration_.restore(state.calibration);
  fused_.restore(state.fused);
  path_.restore(state.path);
  controller_.restore(state.controller);
  own_ = state.own;
  command_ = state.command;
}

void ControlLoop::restart() noexcept {
  fused_.restart();
  path_.restart();
  health_.restart();
  calibration_.close();
  own_.has_path = 0;
  own_.force_n = own_.force_sigma_n = 0.0F;
  own_.force_count = own_.force_due = 0;
}

auto ControlLoop::step(const hal::Sample& sample) noexcept -> std::optional<LoopOutput> {
  std::uint32_t present = 0;
  if (sample.has(Signal::kSpeed)) present |= SampleGate::kSpeed;
  if (sample.has(Signal::kPowerMeter)) present |= SampleGate::kPower;
  const SampleGate::Output gated = gate_.step({.time_ns = sample.time_ns,
                                               .values = {.voltage_v = sample.voltage_v,
                                                          .current_a = sample.current_a,
                                                          .speed_rad_s = sample.speed_rad_s,
                                                          .power_w = sample.power_meter_w},
                                               .present = present});
  own_.faults = own_.faults | gated.faults;
  if (gated.verdict == SampleGate::Verdict::kDrop) return std::nullopt;
  if (gated.verdict == SampleGate::Verdict::kRestart) restart();
  note_commands(sample);
  note_slow(gated.present);
  const bool by_motor = config_.estimator != EstimatorName::kDynamometer;
  if (by_motor) observe_motor(gated);

  own_.time_ns = sample.time_ns;
  // The very first sample ends no interval: the windows close at whole periods after it. A force,
  // though, stands for the period that ends with it, so that each can have its answer.
  own_.elapsed_periods += own_.started != 0 || !by_motor ? gated.elapsed_periods : 0.0F;
  own_.started = 1;
  if (own_.elapsed_periods < static_cast<float>(config_.samples_per_estimate) - 0.5F) {
    return std::nullopt;
  }
  own_.elapsed_periods = 0.0F;
  return close_estimate();
}

void ControlLoop::note_slow(std::uint32_t present) noexcept {
  const SampleGate::Values& values = gate_.values();
  own_.speed_rad_s = values.speed_rad_s;
  own_.speed_present = (present & SampleGate::kSpeed) != 0 ? 1U : 0U;
  own_.meter_w = values.power_w;
  own_.meter_present = (present & SampleGate::kPower) != 0 ? 1U : 0U;
  if (own_.speed_present == 0) return;
  own_.speed_sum_rad_s += values.speed_rad_s;
  ++own_.speed_count;
}

void ControlLoop::observe_motor(const SampleGate::Output& gated) noexcept {
  const SampleGate::Values& values = gate_.values();
  const estimator::FrontEnd::Output front =
      front_end_.step({.voltage_v = values.voltage_v, .current_a = values.current_a});
  // Samples that are missing or held shift the phase of all that follow in the window.
  if (gated.missing_samples != 0 || gated.verdict == SampleGate::Verdict::kBridge) {
    calibration_.close();
  }
  if (calibration_.is_open()) {
    estimator::IdleCalibration::Channels channels{};
    const estimator::Calibration& c = own_.calibration;
    for (std::size_t k = 0; k < 3; ++k) {
      channels[k] = c.voltage_gain_ratio[k] * (values.voltage_v[k] - c.voltage_offset_v[k]);
      channels[k + 3] = c.current_gain_ratio[k] * (values.current_a[k] - c.current_offset_a[k]);
    }
    if (!config_.current_w_present) channels[5] = -(channels[3] + channels[4]);
    calibration_.step(channels);
  }
  health_.observe({.voltage_v = values.voltage_v,
                   .current_a = values.current_a,
                   .motor = front.motor,
                   .current_residual_a = front.current_residual_a,
                   .elapsed_periods = gated.elapsed_periods,
                   .at_end_channels = gated.at_end_channels});
  estimate_from(front, gated.elapsed_periods);
}

void ControlLoop::estimate_from(const estimator::FrontEnd::Output& front,
                                float elapsed_periods) noexcept {
  const bool speed_valid = own_.speed_present != 0;
  const bool meter_valid = own_.meter_present != 0;
  if (config_.estimator == EstimatorName::kFused) {
    fused_.step({.motor = front.motor,
                 .speed_rad_s = own_.speed_rad_s,
                 .power_meter_w = own_.meter_w,
                 .elapsed_periods = elapsed_periods,
                 .speed_valid = speed_valid,
                 .meter_valid = meter_valid});
    return;
  }
  const auto path =
      path_.step({.motor = front.motor,
                  .speed_rad_s = own_.speed_rad_s,
                  .power_meter_w = own_.meter_w,
                  .motor_valid = true,
                  .speed_valid = speed_valid,
                  .meter_valid = meter_valid,
                  .feed = own_.feed == 1 ? estimator::Feed::kAir : estimator::Feed::kUnknown});
  if (path) {
    own_.path = *path;
    own_.has_path = 1;
  }
}

}  // namespace cutforce::firmware
