#include "firmware/host/bench/bench_lathe.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "hal/host/simulation/arithmetic.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::Signal;
using hal::host::kTwoPi;

constexpr double kAtSpeed_ratio = 0.95;
constexpr double kPartStart_s = 0.2;  // how long the CNC says so
constexpr double kRest_m_s = 1e-6;    // a slower feed is a feed hold

float range_of(const std::array<hal::host::ChannelConfig, 3>& channels, double otherwise) noexcept {
  const double range = std::max(channels[0].range, channels[1].range);
  return static_cast<float>(range > 0.0 ? range : otherwise);
}

std::optional<float> share(const hal::Sample& sample, Signal signal, float value, float full) {
  if (!sample.has(signal)) return std::nullopt;
  return value / full;
}

bool is_overload(std::optional<float> ratio) noexcept { return ratio && std::abs(*ratio) > 1.0F; }

double highest_speed(const hal::host::Profile& reference) {
  double highest_rad_s = 0.0;
  for (const auto& point : reference.points()) {
    highest_rad_s = std::max(highest_rad_s, std::abs(point.value));
  }
  return highest_rad_s;
}

}  // namespace

FullScale full_scale_of(const Scenario& scenario) noexcept {
  const auto& s = scenario.simulation;
  const double line_v = std::sqrt(3.0) * s.motor.rated_flux_vs * s.motor.rated_speed_rad_s;
  return {
      .voltage_v = range_of(s.sensors.voltage, 2.0 * line_v),
      .current_a = range_of(s.sensors.current, 2.0 * std::sqrt(2.0) * s.motor.rated_current_a_rms)};
}

std::expected<BenchLathe, InputError> BenchLathe::make(const Scenario& scenario, std::uint8_t node,
                                                       std::uint32_t speed_every) {
  if (scenario.model != Model::kMotor) {
    return std::unexpected{InputError{
        scenario.title, "a machine without its motor has no signals to send",
        "choose a scenario with model = \"motor\", as host_tests/scenarios/bench_lathe.toml"}};
  }
  const double period_us = 1e6 / scenario.simulation.sample_rate_hz;
  if (period_us != std::round(period_us)) {
    return std::unexpected{InputError{scenario.title + ": sample_rate_hz",
                                      "a sample does not last whole microseconds",
                                      "choose a divisor of 1000000, such as 1000"}};
  }
  auto machine = hal::host::SimulatedMachine::make(scenario.simulation);
  if (!machine) return std::unexpected{machine.error()};
  return BenchLathe{scenario, std::move(*machine), node, std::max(speed_every, 1U)};
}

BenchLathe::BenchLathe(const Scenario& scenario, hal::host::SimulatedMachine machine,
                       std::uint8_t node, std::uint32_t speed_every)
    : machine_(std::move(machine)),
      node_(node),
      speed_every_(speed_every),
      full_scale_(full_scale_of(scenario)),
      period_ns_(static_cast<std::int64_t>(std::round(1e9 / scenario.simulation.sample_rate_hz))),
      duration_s_(scenario.duration_s),
      speed_rad_s_(highest_speed(scenario.simulation.drive.speed_reference_rad_s)),
      sample_(machine_.advance()) {
  note_machine();
}

auto BenchLathe::advance(std::uint8_t override_pct) noexcept -> Frames {
  Frames out{};
  if (sample_.time_ns > index_ * period_ns_) {  // a gap
    ++index_;
    return out;
  }
  const hal::can::Frame values = phases();
  if (index_ % speed_every_ == 0) out.frames[out.count++] = spindle();
  out.frames[out.count++] = values;
  ++index_;
  machine_.set_override(static_cast<double>(override_pct));
  sample_ = machine_.advance();
  note_machine();
  return out;
}

void BenchLathe::note_machine() noexcept {
  const auto& feed = machine_.config().feed;
  const auto& truth = machine_.truth();
  const double turns_s = truth.speed_rad_s / (machine_.config().spindle.gear_ratio * kTwoPi);
  const double time_s = static_cast<double>(truth.time_ns) * 1e-9;
  const double programmed_m_s = feed.feed_m_rev > 0.0 ? feed.feed_m_rev * turns_s : feed.feed_m_s;
  known_ = {.spindle_at_speed = std::abs(truth.speed_rad_s) >= kAtSpeed_ratio * speed_rad_s_,
            .cutting_feed = sample_.feed_active > 0.5F && truth.feed_m_s > kRest_m_s,
            .part_start = time_s >= feed.start_s && time_s < feed.start_s + kPartStart_s,
            .override_applied_pct =
                static_cast<std::uint8_t>(std::clamp(std::round(truth.override_pct), 0.0, 254.0)),
            .feed_m_s = static_cast<float>(programmed_m_s),
            .diameter_m = static_cast<float>(truth.diameter_m)};
}

hal::can::Frame BenchLathe::spindle() noexcept {
  const auto value = [this](Signal signal, float number) {
    return sample_.has(signal) ? std::optional{number} : std::nullopt;
  };
  return hal::can::pack(
      hal::can::Spindle{.count = static_cast<std::uint8_t>(index_),
                        .speed_rad_s = value(Signal::kSpeed, sample_.speed_rad_s),
                        .power_meter_w = value(Signal::kPowerMeter, sample_.power_meter_w),
                        .overruns = 0,
                        .overload = std::exchange(overload_, false)},
      node_);
}

hal::can::Frame BenchLathe::phases() noexcept {
  const auto& [volts, amperes] = full_scale_;
  const hal::can::Phases message{
      .count = static_cast<std::uint8_t>(index_),
      .voltage_ratio = {share(sample_, Signal::kVoltageU, sample_.voltage_v[0], volts),
                        share(sample_, Signal::kVoltageV, sample_.voltage_v[1], volts)},
      .current_ratio = {share(sample_, Signal::kCurrentU, sample_.current_a[0], amperes),
                        share(sample_, Signal::kCurrentV, sample_.current_a[1], amperes)}};
  overload_ = overload_ || std::ranges::any_of(message.voltage_ratio, is_overload) ||
              std::ranges::any_of(message.current_ratio, is_overload);
  return hal::can::pack(message, node_);
}

}  // namespace cutforce::firmware::host
