#include "firmware/control_loop.hpp"

// What the loop does with raw samples until an estimate is due: in runs where they are usual, alone
// where they are not.

namespace cutforce::firmware {
namespace {

using estimator::SampleGate;
using hal::Signal;

}  // namespace

bool ControlLoop::step(std::span<const hal::Sample>& samples, LoopOutput& row) noexcept {
  while (!samples.empty()) {
    std::size_t taken = step_run(samples);
    if (taken == 0) {
      step_alone(samples.front());
      taken = 1;
    }
    samples = samples.subspan(taken);
    if (own_.elapsed_periods < config_.close_at_periods) continue;
    own_.elapsed_periods = 0.0F;
    close_estimate(row);
    return true;
  }
  return false;
}

// To the end of the estimate window, and of the path's.
std::size_t ControlLoop::longest_run(std::size_t samples) const noexcept {
  constexpr float kAlmost = 1023.0F / 1024.0F;  // periods come in whole 1024ths
  std::size_t most = samples < SampleRun::kMost ? samples : SampleRun::kMost;
  const auto window =
      static_cast<std::uint32_t>(config_.close_at_periods - own_.elapsed_periods + kAlmost);
  if (window < most) most = window;
  if (config_.estimator == EstimatorName::kFused) return most;
  return path_.samples_left() < most ? path_.samples_left() : most;
}

// Usual samples: how many there were. With a dynamometer nobody looks at them.
std::size_t ControlLoop::step_run(std::span<const hal::Sample> samples) noexcept {
  if (config_.estimator == EstimatorName::kDynamometer) return 0;
  SampleRun run;
  run.speed_sum_rad_s =
      config_.estimator == EstimatorName::kFused ? fused_.speed_sum_rad_s() : own_.speed_sum_rad_s;
  run.take(samples.first(longest_run(samples.size())), gate_, front_end_);
  if (run.count != 0) pass_run(samples.first(run.count), run);
  return run.count;
}

void ControlLoop::pass_run(std::span<const hal::Sample> samples, const SampleRun& run) noexcept {
  const auto count = static_cast<std::uint32_t>(run.count);
  const std::span<const estimator::MotorSample> motor(run.motor.data(), run.count);
  // What neither this run nor the sample before says needs no look.
  if (((samples.front().present | own_.commands_present) & kCommands) != 0) note_commands(samples);
  if (calibration_.is_open()) [[unlikely]] {
    for (const hal::Sample& sample : samples) calibrate_from(sample.voltage_v, sample.current_a);
  }
  if (const std::uint32_t k = health_.wanted(count); k < count) {
    const hal::Sample& sample = samples[k];
    health_.look(sample.voltage_v, sample.current_a, motor[k],
                 front_end_.residual_a(sample.current_a), count - 1 - k);
  }
  const bool speed_valid = speed_present();
  const bool meter_valid = (gate_.state().last_present & SampleGate::kPower) != 0;
  own_.elapsed_periods += static_cast<float>(count);
  if (config_.estimator == EstimatorName::kFused) {
    fused_.step_run(motor);
    if (speed_valid) fused_.note_speeds(run.speed_sum_rad_s, count);
    if (meter_valid) fused_.note_meter(samples.back().power_meter_w);
    return;
  }
  if (speed_valid) {
    own_.speed_sum_rad_s = run.speed_sum_rad_s;
    own_.speed_count += count;
  }
  if (path_.add_run(motor, samples, speed_valid, meter_valid)) close_path();
}

// Any sample at all.
void ControlLoop::step_alone(const hal::Sample& sample) noexcept {
  const SampleGate::Output gated =
      gate_.step({.time_ns = sample.time_ns,
                  .values = {.voltage_v = sample.voltage_v,
                             .current_a = sample.current_a,
                             .speed_rad_s = sample.speed_rad_s,
                             .power_w = sample.power_meter_w},
                  .present = sample.present >> static_cast<unsigned>(Signal::kSpeed) &
                             (SampleGate::kSpeed | SampleGate::kPower)});
  own_.faults = own_.faults | gated.faults;
  if (gated.verdict == SampleGate::Verdict::kDrop) return;
  if (gated.verdict == SampleGate::Verdict::kRestart) restart();
  // Samples that are missing or held shift the phase of all that follow in the window.
  if (gated.missing_samples != 0 || gated.verdict == SampleGate::Verdict::kBridge) {
    calibration_.close();
  }
  // The very first sample ends no interval: the windows close at whole periods after it. A force,
  // though, stands for the period that ends with it, so that each can have its answer.
  const bool counts = own_.started != 0 || config_.estimator == EstimatorName::kDynamometer;
  own_.started = 1;
  if (((sample.present | own_.commands_present) & kCommands) != 0) note_commands({&sample, 1});
  if (counts) own_.elapsed_periods += gated.elapsed_periods;
  const SampleGate::Values& values = gate_.values();
  const bool speed_valid = (gated.present & SampleGate::kSpeed) != 0;
  if (config_.estimator == EstimatorName::kDynamometer) {
    if (speed_valid) note_speed(values.speed_rad_s, 1);
    return;
  }
  if (calibration_.is_open()) calibrate_from(values.voltage_v, values.current_a);
  const auto front =
      front_end_.step({.voltage_v = values.voltage_v, .current_a = values.current_a});
  health_.observe({.voltage_v = values.voltage_v,
                   .current_a = values.current_a,
                   .motor = front.motor,
                   .current_residual_a = front.current_residual_a,
                   .elapsed_periods = gated.elapsed_periods,
                   .at_end_channels = gated.at_end_channels});
  estimate_alone(front.motor, gated);
}

void ControlLoop::estimate_alone(const estimator::MotorSample& motor,
                                 const SampleGate::Output& gated) noexcept {
  const SampleGate::Values& values = gate_.values();
  const bool speed_valid = (gated.present & SampleGate::kSpeed) != 0;
  const bool meter_valid = (gated.present & SampleGate::kPower) != 0;
  if (config_.estimator == EstimatorName::kFused) {
    fused_.step({.motor = motor,
                 .speed_rad_s = values.speed_rad_s,
                 .power_meter_w = values.power_w,
                 .elapsed_periods = gated.elapsed_periods,
                 .speed_valid = speed_valid,
                 .meter_valid = meter_valid});
    return;
  }
  if (speed_valid) note_speed(values.speed_rad_s, 1);
  if (path_.add({.motor = motor,
                 .speed_rad_s = values.speed_rad_s,
                 .power_meter_w = values.power_w,
                 .motor_valid = true,
                 .speed_valid = speed_valid,
                 .meter_valid = meter_valid,
                 .feed = estimator::Feed::kUnknown}))
    close_path();
}

void ControlLoop::close_path() noexcept {
  path_.close_window(own_.feed == 1 ? estimator::Feed::kAir : estimator::Feed::kUnknown, own_.path);
  own_.has_path = 1;
}

void ControlLoop::note_speed(float sum_rad_s, std::uint32_t count) noexcept {
  own_.speed_sum_rad_s += sum_rad_s;
  own_.speed_count += count;
}

void ControlLoop::calibrate_from(const std::array<float, 3>& voltage_v,
                                 const std::array<float, 3>& current_a) noexcept {
  estimator::IdleCalibration::Channels channels{};
  const estimator::Calibration& c = front_end_.state().calibration;
  for (std::size_t k = 0; k < 3; ++k) {
    channels[k] = c.voltage_gain_ratio[k] * (voltage_v[k] - c.voltage_offset_v[k]);
    channels[k + 3] = c.current_gain_ratio[k] * (current_a[k] - c.current_offset_a[k]);
  }
  if (!config_.current_w_present) channels[5] = -(channels[3] + channels[4]);
  calibration_.step(channels);
}

}  // namespace cutforce::firmware
