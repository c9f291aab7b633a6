#include "hal/host/simulation/force_machine.hpp"

#include <cmath>

#include "hal/host/simulation/arithmetic.hpp"
#include "hal/host/simulation/config_checker.hpp"

namespace cutforce::hal::host {
namespace {

constexpr double kFullSpeed_rad_s = 1000.0;  // the cut is told that the spindle turns forwards

std::uint32_t whole(double ratio) noexcept {
  return static_cast<std::uint32_t>(std::floor(ratio + 0.5));
}

}  // namespace

std::expected<void, InputError> ForceMachineConfig::check() const {
  ConfigChecker c;
  c.within(step_s, "step_s", 1e-5, 0.1);
  c.within(sample_s, "sample_s", 1e-4, 10.0);
  const double ratio = sample_s / step_s;
  c.require(ratio >= 0.999 && std::abs(ratio - std::floor(ratio + 0.5)) < 1e-6 * ratio, "step_s",
            "does not divide the control period",
            "give control_period_s divided by a whole number");
  c.positive(programmed_speed_1_s, "spindle.programmed_speed_1_s", 1e4);
  c.profile(speed_ratio, "spindle.speed_ratio", 0.01, 100.0);
  c.positive(gear_ratio, "spindle.gear_ratio", 1e3);
  check_cut(c, process, feed);
  c.within(sensor.lag_s, "sensor.lag_s", 0.0, 10.0);
  c.within(sensor.mean_s, "sensor.mean_s", 0.0, 10.0);
  c.within(sensor.dead_time_s, "sensor.dead_time_s", 0.0, 10.0);
  c.within(sensor.gain_ratio, "sensor.gain_ratio", -100.0, 100.0);
  c.within(sensor.noise_ratio, "sensor.noise_ratio", 0.0, 10.0);
  c.within(sensor.noise_n, "sensor.noise_n", 0.0, 1e6);
  c.within(sensor.noise_correlation_s, "sensor.noise_correlation_s", 0.0, 10.0);
  return c.result();
}

std::expected<ForceMachine, InputError> ForceMachine::make(const ForceMachineConfig& config) {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return ForceMachine{config};
}

ForceMachine::ForceMachine(const ForceMachineConfig& config)
    : config_(config),
      steps_per_sample_(whole(config.sample_s / config.step_s)),
      turns_s_(config.programmed_speed_1_s * speed_.value(config.speed_ratio, 0.0)),
      feed_(config.feed, config.step_s, config.seed),
      process_(config.process, {}, {}, 1.0, config.step_s),
      sensor_(config.sensor, config.step_s, config.sample_s, config.seed) {
  if (!config.starts_in_cut) return;
  feed_.settle(turns_s_);
  process_.settle(process_input());
  sensor_.settle(process_.state().force_n);
}

ProcessInput ForceMachine::process_input() noexcept {
  return {.time_s = time_s(),
          .position_m = feed_.state().position_m,
          .feed_m_s = feed_.state().feed_m_s,
          .spindle_turns_s = turns_s_,
          .spindle_turns = turns_,
          .motor_speed_rad_s = kFullSpeed_rad_s};
}

void ForceMachine::step() noexcept {
  turns_s_ = config_.programmed_speed_1_s * speed_.value(config_.speed_ratio, time_s());
  turns_ += turns_s_ * config_.step_s;
  feed_.step(time_s(), turns_s_);
  process_.step(process_input());
  sensor_.step(process_.state().force_n);
  ++steps_;
}

Sample ForceMachine::read() noexcept {
  Sample sample{};
  sample.time_ns = static_cast<std::int64_t>(std::floor(time_s() * 1e9 + 0.5));
  sample.measured_force_n = static_cast<float>(sensor_.read());
  sample.present = bit(Signal::kMeasuredForce);
  if (config_.speed_present) {
    sample.speed_rad_s = static_cast<float>(kTwoPi * turns_s_ * config_.gear_ratio);
    sample.present |= bit(Signal::kSpeed);
  }
  if (config_.override_applied_present) {
    sample.override_applied_pct = static_cast<float>(feed_.state().override_pct);
    sample.present |= bit(Signal::kOverrideApplied);
  }
  return sample;
}

auto ForceMachine::truth() const noexcept -> Truth {
  return {.time_s = time_s(),
          .force_n = process_.state().force_n,
          .position_m = feed_.state().position_m,
          .feed_m_s = feed_.state().feed_m_s,
          .depth_m = process_.state().depth_m,
          .override_pct = feed_.state().override_pct};
}

}  // namespace cutforce::hal::host
