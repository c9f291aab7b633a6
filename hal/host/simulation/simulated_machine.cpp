#include "hal/host/simulation/simulated_machine.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cutforce::hal::host {
namespace {

std::int64_t whole_ns(double time_s) noexcept {
  return static_cast<std::int64_t>(std::floor(time_s * 1e9 + 0.5));
}

// The filters' poles must be resolved too.
double longest_step(const SimulatedMachineConfig& config) noexcept {
  if (!(config.inverter.anti_alias_hz > 0.0)) return config.integration_step_s;
  return std::min(config.integration_step_s, 0.25 / (kTwoPi * config.inverter.anti_alias_hz));
}

std::array<Channel, 3> channels(const std::array<ChannelConfig, 3>& c, std::uint64_t seed,
                                std::uint64_t first) noexcept {
  return {Channel{c[0], seed, first}, Channel{c[1], seed, first + 1},
          Channel{c[2], seed, first + 2}};
}

// What every sample carries.
std::uint32_t presence(const SensorConfig& s) noexcept {
  std::uint32_t present = bit(Signal::kVoltageU) | bit(Signal::kVoltageV) | bit(Signal::kVoltageW) |
                          bit(Signal::kCurrentU) | bit(Signal::kCurrentV);
  const auto add = [&present](bool there, Signal signal) {
    if (there) present |= bit(signal);
  };
  add(s.current_w_present, Signal::kCurrentW);
  add(s.speed.present, Signal::kSpeed);
  add(s.power_meter.present, Signal::kPowerMeter);
  add(s.dynamometer.present, Signal::kMeasuredForce);
  add(s.feed_active_present, Signal::kFeedActive);
  add(s.override_applied_present, Signal::kOverrideApplied);
  add(s.diameter_present, Signal::kWorkpieceDiameter);
  add(s.feed_rate_present, Signal::kFeedRate);
  return present;
}

}  // namespace

std::expected<SimulatedMachine, InputError> SimulatedMachine::make(
    const SimulatedMachineConfig& config) {
  if (auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return SimulatedMachine{config};
}

SimulatedMachine::SimulatedMachine(const SimulatedMachineConfig& config)
    : config_(config),
      hold_ns_(whole_ns(config.drive.period_s)),
      hold_s_(static_cast<double>(hold_ns_) * 1e-9),
      sample_s_(1.0 / config.sample_rate_hz),
      longest_step_s_(longest_step(config)),
      voltage_lead_ns_(whole_ns(config.sensors.voltage_lead_s)),
      plant_(config.motor, config.spindle, kTwoPi * config.inverter.anti_alias_hz),
      inverter_(config.inverter, hold_s_),
      drive_(config.drive, config.motor, config.spindle.inertia_kg_m2, config.inverter.dc_link_v),
      feed_(config.feed, hold_s_, config.seed),
      process_(config.process, config.load, config.load_friction, config.spindle.gear_ratio,
               hold_s_),
      voltage_channel_(channels(config.sensors.voltage, config.seed, 10)),
      current_channel_(channels(config.sensors.current, config.seed, 13)),
      speed_sensor_(config.sensors.speed, sample_s_, config.seed),
      power_meter_(config.sensors.power_meter, hold_s_, config.seed),
      dynamometer_(config.sensors.dynamometer, sample_s_, config.seed),
      faults_(config.faults),
      present_(presence(config.sensors)) {}

std::int64_t SimulatedMachine::sample_time_ns(std::int64_t index) const noexcept {
  return static_cast<std::int64_t>(
      std::floor(static_cast<double>(index) * 1e9 / config_.sample_rate_hz + 0.5));
}

Sample SimulatedMachine::advance() noexcept {
  constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();
  for (;;) {
    const std::int64_t sample_ns = sample_time_ns(index_);
    const std::int64_t rest_ns = has_rest_ ? kNever : sample_ns;
    const std::int64_t voltage_ns =
        has_voltages_ ? kNever : std::max(sample_ns + voltage_lead_ns_, now_ns_);
    run_to(std::min({next_control_ns_, rest_ns, voltage_ns}));
    if (now_ns_ == next_control_ns_) control();
    if (now_ns_ == voltage_ns) read_voltages();
    if (now_ns_ == rest_ns) read_currents_and_rest();
    if (!has_voltages_ || !has_rest_) continue;
    has_voltages_ = false;
    has_rest_ = false;
    ++index_;
    if (faults_.pass(static_cast<double>(sample_ns) * 1e-9, sample_)) return sample_;
  }
}

void SimulatedMachine::run_to(std::int64_t time_ns) noexcept {
  while (now_ns_ < time_ns) {
    std::int64_t until_ns = time_ns;
    const Inverter::Edge* edge = config_.inverter.switched ? inverter_.next_edge() : nullptr;
    if (edge != nullptr) until_ns = std::min(until_ns, hold_begin_ns_ + edge->offset_ns);
    if (until_ns > now_ns_) {
      const double length_s = static_cast<double>(until_ns - now_ns_) * 1e-9;
      const double pieces = std::ceil(length_s / longest_step_s_ - 1e-9);
      const double step_s = length_s / pieces;
      for (int k = 0; k < static_cast<int>(pieces); ++k) {
        energy_j_ += 1.5 * dot(input_.voltage_v, plant_.step(state_, input_, step_s));
      }
      now_ns_ = until_ns;
    }
    if (edge != nullptr && now_ns_ == hold_begin_ns_ + edge->offset_ns) {
      inverter_.take_edge();
      input_.voltage_v = inverter_.switched_v();
    }
  }
}

void SimulatedMachine::control() noexcept {
  const double time_s = static_cast<double>(now_ns_) * 1e-9;
  if (now_ns_ > 0) {
    power_w_ = energy_j_ / hold_s_;
    energy_j_ = 0.0;
    power_meter_.step(power_w_);
  }
  const MotorInstant at = plant_.instant(state_, input_);
  plant_.motor().warm(plant_.motor().stator_copper_w(at), hold_s_);

  before_ = hold_;
  hold_ = after_;
  hold_.mean_v = inverter_.mean_v(hold_.duty, at.line_current_a);
  hold_begin_ns_ = now_ns_;
  next_control_ns_ = now_ns_ + hold_ns_;
  if (config_.inverter.switched) {
    inverter_.begin_hold(hold_.duty, at.line_current_a);
    input_.voltage_v = inverter_.switched_v();
  } else {
    input_.voltage_v = hold_.mean_v;
  }

  const Complex wanted_v = drive_.step({.time_s = time_s,
                                        .current_a = at.line_current_a,
                                        .rotor_flux_vs = state_.flux.rotor_vs,
                                        .speed_rad_s = state_.speed_rad_s});
  after_.duty = inverter_.duties(wanted_v);
  after_.reference_v = inverter_.ideal_v(after_.duty);
  after_.mean_v = inverter_.mean_v(after_.duty, at.line_current_a);
  drive_.realised(after_.reference_v);
  step_cut(time_s);
}

void SimulatedMachine::step_cut(double time_s) noexcept {
  const double gear = config_.spindle.gear_ratio;
  const double turns_s = state_.speed_rad_s / (gear * kTwoPi);
  feed_.step(time_s, turns_s);
  process_.step({.time_s = time_s,
                 .position_m = feed_.state().position_m,
                 .feed_m_s = feed_.state().feed_m_s,
                 .spindle_turns_s = turns_s,
                 .spindle_turns = state_.angle_rad / (gear * kTwoPi),
                 .motor_speed_rad_s = state_.speed_rad_s});
  input_.cut_load_nm = process_.state().load_torque_nm;
  input_.friction_ratio = friction_.value(config_.friction_ratio, time_s);
}

Complex SimulatedMachine::voltage_signal() const noexcept {
  switch (config_.sensors.voltage_signal) {
    case VoltageSignal::kReference:
      return hold_.reference_v;
    case VoltageSignal::kInstantaneous:
      return config_.inverter.anti_alias_hz > 0.0 ? state_.filter.voltage_v : input_.voltage_v;
    case VoltageSignal::kMean:
      break;
  }
  // Half a hold to either side; the hold to come is known, for the drive has computed it, (S15).
  const double share =
      static_cast<double>(now_ns_ - hold_begin_ns_) / static_cast<double>(hold_ns_);
  if (share < 0.5) return (0.5 - share) * before_.mean_v + (0.5 + share) * hold_.mean_v;
  return (1.5 - share) * hold_.mean_v + (share - 0.5) * after_.mean_v;
}

void SimulatedMachine::read_voltages() noexcept {
  auto phase_v = to_phases(voltage_signal());
  if (config_.sensors.voltage_kind == VoltageKind::kLineToLine) {
    phase_v = {phase_v[0] - phase_v[1], phase_v[1] - phase_v[2], phase_v[2] - phase_v[0]};
  }
  for (std::size_t k = 0; k < 3; ++k) {
    sample_.voltage_v[k] = static_cast<float>(voltage_channel_[k].read(phase_v[k]));
  }
  has_voltages_ = true;
}

void SimulatedMachine::read_currents_and_rest() noexcept {
  const MotorInstant at = plant_.instant(state_, input_);
  const bool filtered = config_.inverter.anti_alias_hz > 0.0;
  const auto phase_a = to_phases(filtered ? state_.filter.current_a : at.line_current_a);
  sample_.time_ns = now_ns_;
  for (std::size_t k = 0; k < 3; ++k) {
    const double current_a = current_channel_[k].read(phase_a[k]);
    sample_.current_a[k] =
        k < 2 || config_.sensors.current_w_present ? static_cast<float>(current_a) : 0.0F;
  }
  const auto& feed = feed_.state();
  const bool cutting_move = feed.feeding && feed.position_m >= config_.feed.cutting_move_start_m;
  sample_.present = present_;
  const auto put = [this](Signal signal, double value) {
    value_of(sample_, signal) = sample_.has(signal) ? static_cast<float>(value) : 0.0F;
  };
  put(Signal::kSpeed, speed_sensor_.read(state_.speed_rad_s, state_.angle_rad));
  put(Signal::kPowerMeter, power_meter_.output_w());
  put(Signal::kMeasuredForce, dynamometer_.read(process_.state().force_n));
  put(Signal::kFeedActive, cutting_move ? 1.0 : 0.0);
  put(Signal::kOverrideApplied, feed.override_pct);
  put(Signal::kWorkpieceDiameter, process_.state().diameter_m);
  put(Signal::kFeedRate, feed.feed_m_s);
  note_truth(at);
  has_rest_ = true;
}

void SimulatedMachine::note_truth(const MotorInstant& at) noexcept {
  const auto& cut = process_.state();
  const double flux_squared = std::max(squared(state_.flux.rotor_vs), 1e-12);
  truth_ = {.time_ns = now_ns_,
            .airgap_torque_nm = at.torque_nm,
            .load_torque_nm = cut.load_torque_nm + plant_.friction_nm(state_.speed_rad_s, input_),
            .cutting_torque_nm = cut.cutting_torque_nm,
            .cutting_force_n = cut.force_n,
            .speed_rad_s = state_.speed_rad_s,
            .feed_m_s = feed_.state().feed_m_s,
            .depth_m = cut.depth_m,
            .position_m = feed_.state().position_m,
            .diameter_m = cut.diameter_m,
            .override_pct = feed_.state().override_pct,
            .input_power_w = power_w_,
            .stator_resistance_ohm = plant_.motor().stator_resistance_ohm(),
            .slip_speed_rad_s = cross(state_.flux.rotor_vs, at.rotor_slope_v) / flux_squared -
                                config_.motor.pole_pairs * state_.speed_rad_s};
}

}  // namespace cutforce::hal::host
