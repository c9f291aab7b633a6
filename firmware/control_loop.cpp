#include "firmware/control_loop.hpp"

namespace cutforce::firmware {
namespace {

using estimator::SampleGate;
using hal::Signal;

}  // namespace

ControlLoop::ControlLoop(const Config& config) noexcept
    : config_{.estimator = config.estimator,
              .control = config.control,
              .current_w_present = config.current_w_present,
              .sensorless = config.fused.sensorless,
              .calibrates = config.fused.calibrate,
              .estimates_per_control = config.estimates_per_control,
              .close_at_periods = static_cast<float>(config.samples_per_estimate) - 0.5F,
              .sample_period_s = config.gate.sample_period_s,
              .tick_period_s = config.health.tick_period_s,
              .dynamometer_sigma_n = config.dynamometer_sigma_n,
              .dynamometer_cut_n =
                  config.controller.cut_state.on_ratio * config.controller.force_reference_n,
              .voltage_lead_s = config.voltage_lead_s,
              .force_minimum_speed_rad_s = config.force_minimum_speed_rad_s,
              .programmed_speed_rad_s = config.programmed_speed_rad_s,
              .fused_pole_pairs = config.fused.flux.pole_pairs,
              .path_pole_pairs = config.path.synchronous.pole_pairs},
      gate_(*SampleGate::make(config.gate)),
      front_end_(*estimator::FrontEnd::make(config.front_end)),
      fused_(estimator::FusedObserver::make_checked(config.fused)),
      health_(estimator::SignalHealth::make_checked(config.health)),
      calibration_(*estimator::IdleCalibration::make(config.calibration)),
      path_(estimator::TorquePath::make_checked(config.path)),
      load_friction_(*estimator::LoadFriction::make(config.load_friction)),
      force_(*estimator::CuttingForce::make(config.force)),
      controller_(control::ControlPath::make_checked(config.controller)) {
  own_.diameter_m = config.fixed_diameter_m;
  const auto neutral =
      static_cast<std::uint8_t>(config.controller.feed_override.initial_pct + 0.5F);
  command_ = {.time_ns = 0,
              .override_pct = neutral,
              .override_code = control::encode(config.controller.code, neutral),
              .controlling = false};
}

auto ControlLoop::Config::check() const noexcept -> std::expected<void, ConfigError> {
  const auto fail = [](ConfigError error) { return std::unexpected{error}; };
  if (samples_per_estimate < 1 || estimates_per_control < 1) {
    return fail(ConfigError::kPeriods);
  }
  if (!gate.check()) return fail(ConfigError::kGate);
  if (!front_end.check()) return fail(ConfigError::kFrontEnd);
  if (!health.check()) return fail(ConfigError::kHealth);
  if (!calibration.check()) return fail(ConfigError::kCalibration);
  if (!fused.check()) return fail(ConfigError::kFused);
  if (!path.check()) return fail(ConfigError::kTorquePath);
  if (!load_friction.check()) return fail(ConfigError::kLoadFriction);
  if (!force.check()) return fail(ConfigError::kCuttingForce);
  if (!controller.check()) return fail(ConfigError::kControl);
  return {};
}

auto ControlLoop::make(const Config& config) noexcept -> std::expected<ControlLoop, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
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
  note_speed(fused_.speed_sum_rad_s(), fused_.speed_count());
  fused_.restart();
  path_.restart();
  health_.restart();
  calibration_.close();
  own_.has_path = 0;
  own_.force_n = own_.force_sigma_n = 0.0F;
  own_.force_count = own_.force_due = 0;
}

// Shared by both ways through step(): inlined, so that in the short one the compiler knows that one
// period has elapsed and nothing is at fault. On a Cortex-M7 that halves a raw sample.
[[gnu::always_inline]] inline auto ControlLoop::go_on(const hal::Sample& sample,
                                                      const SampleGate::Values& values,
                                                      const Passed& passed) noexcept
    -> std::optional<LoopOutput> {
  // What neither this sample nor the one before says needs no look.
  if (((sample.present | own_.commands_present) & kCommands) != 0) note_commands(sample);
  if (config_.estimator == EstimatorName::kDynamometer) {
    if ((passed.present & SampleGate::kSpeed) != 0) note_speed(values.speed_rad_s, 1);
  } else {
    const estimator::MotorSample motor = front_end_.motor(values.voltage_v, values.current_a);
    if (calibration_.is_open()) [[unlikely]]
      calibrate_from(gate_.values());
    if (health_.wants(passed.elapsed_periods, passed.at_end_channels)) {
      health_.look({.voltage_v = values.voltage_v,
                    .current_a = values.current_a,
                    .motor = motor,
                    .current_residual_a = front_end_.residual_a(values.current_a),
                    .elapsed_periods = 0.0F,
                    .at_end_channels = passed.at_end_channels});
    }
    estimate_from(motor, values, passed);
  }
  own_.elapsed_periods += passed.counted_periods;
  if (own_.elapsed_periods < config_.close_at_periods) return std::nullopt;
  own_.elapsed_periods = 0.0F;
  return close_estimate();
}

[[gnu::always_inline]] inline void ControlLoop::estimate_from(const estimator::MotorSample& motor,
                                                              const SampleGate::Values& values,
                                                              const Passed& passed) noexcept {
  const bool speed_valid = (passed.present & SampleGate::kSpeed) != 0;
  const bool meter_valid = (passed.present & SampleGate::kPower) != 0;
  if (config_.estimator == EstimatorName::kFused) {
    fused_.step(motor, passed.elapsed_periods);
    if (speed_valid) fused_.note_speed(values.speed_rad_s);
    if (meter_valid) fused_.note_meter(values.power_w);
    return;
  }
  if (speed_valid) note_speed(values.speed_rad_s, 1);
  if (path_.add({.motor = motor,
                 .speed_rad_s = values.speed_rad_s,
                 .power_meter_w = values.power_w,
                 .motor_valid = true,
                 .speed_valid = speed_valid,
                 .meter_valid = meter_valid,
                 .feed = estimator::Feed::kUnknown})) [[unlikely]] {
    close_path();
  }
}

void ControlLoop::close_path() noexcept {
  path_.close_window(own_.feed == 1 ? estimator::Feed::kAir : estimator::Feed::kUnknown, own_.path);
  own_.has_path = 1;
}

auto ControlLoop::step(const hal::Sample& sample) noexcept -> std::optional<LoopOutput> {
  static_assert(hal::bit(Signal::kPowerMeter) == 2 * hal::bit(Signal::kSpeed) &&
                SampleGate::kSpeed == 1 && SampleGate::kPower == 2);
  const std::uint32_t present = sample.present >> static_cast<unsigned>(Signal::kSpeed) &
                                (SampleGate::kSpeed | SampleGate::kPower);
  const auto& v = sample.voltage_v;  // one by one, so that they are read once, into registers
  const auto& i = sample.current_a;
  const SampleGate::Values values{.voltage_v = {v[0], v[1], v[2]},
                                  .current_a = {i[0], i[1], i[2]},
                                  .speed_rad_s = sample.speed_rad_s,
                                  .power_w = sample.power_meter_w};
  if (!gate_.accepts(sample.time_ns, values, present)) [[unlikely]]
    return step_carefully(sample, present);
  return go_on(
      sample, values,
      {.elapsed_periods = 1.0F, .counted_periods = 1.0F, .at_end_channels = 0, .present = present});
}

auto ControlLoop::step_carefully(const hal::Sample& sample, std::uint32_t present) noexcept
    -> std::optional<LoopOutput> {
  const SampleGate::Output gated = gate_.step({.time_ns = sample.time_ns,
                                               .values = {.voltage_v = sample.voltage_v,
                                                          .current_a = sample.current_a,
                                                          .speed_rad_s = sample.speed_rad_s,
                                                          .power_w = sample.power_meter_w},
                                               .present = present});
  own_.faults = own_.faults | gated.faults;
  if (gated.verdict == SampleGate::Verdict::kDrop) return std::nullopt;
  if (gated.verdict == SampleGate::Verdict::kRestart) restart();
  // Samples that are missing or held shift the phase of all that follow in the window.
  if (gated.missing_samples != 0 || gated.verdict == SampleGate::Verdict::kBridge) {
    calibration_.close();
  }
  // The very first sample ends no interval: the windows close at whole periods after it. A force,
  // though, stands for the period that ends with it, so that each can have its answer.
  const bool counts = own_.started != 0 || config_.estimator == EstimatorName::kDynamometer;
  own_.started = 1;
  return go_on(sample, gate_.values(),
               {.elapsed_periods = gated.elapsed_periods,
                .counted_periods = counts ? gated.elapsed_periods : 0.0F,
                .at_end_channels = gated.at_end_channels,
                .present = gated.present});
}

void ControlLoop::note_speed(float sum_rad_s, std::uint32_t count) noexcept {
  own_.speed_sum_rad_s += sum_rad_s;
  own_.speed_count += count;
}

void ControlLoop::calibrate_from(const SampleGate::Values& values) noexcept {
  estimator::IdleCalibration::Channels channels{};
  const estimator::Calibration& c = front_end_.state().calibration;
  for (std::size_t k = 0; k < 3; ++k) {
    channels[k] = c.voltage_gain_ratio[k] * (values.voltage_v[k] - c.voltage_offset_v[k]);
    channels[k + 3] = c.current_gain_ratio[k] * (values.current_a[k] - c.current_offset_a[k]);
  }
  if (!config_.current_w_present) channels[5] = -(channels[3] + channels[4]);
  calibration_.step(channels);
}

}  // namespace cutforce::firmware
