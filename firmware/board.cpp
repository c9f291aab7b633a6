#include "firmware/board.hpp"

#include <algorithm>

namespace cutforce::firmware {
namespace {

using control::Supervisor;
using control::SupervisorState;
using hal::can::Base;
using hal::can::identifier;

constexpr std::int64_t kRateWindow_ns = 500'000'000;
// A rate that is wrong in the machine file is wrong by a factor; the board's clock is jittery.
constexpr float kRateTolerance_ratio = 0.1F;
constexpr float kTurning_rad_s = 1.0F;         // slower is standing still, and noise
constexpr std::int64_t kMostClockSteps = 100;  // after a stall; the rest of the time is forgotten

// Two voltages of three sum to minus the third: exactly between the lines, and to the neutral of a
// motor with three wires but for what drives no current.
hal::Sample with_third_phase(hal::Sample sample) noexcept {
  using hal::Signal;
  if (!sample.has(Signal::kVoltageW) && sample.has(Signal::kVoltageU) &&
      sample.has(Signal::kVoltageV)) {
    sample.voltage_v[2] = -(sample.voltage_v[0] + sample.voltage_v[1]);
    sample.present |= hal::bit(Signal::kVoltageW);
  }
  return sample;
}

}  // namespace

Board::Board(const Config& config) noexcept
    : config_{.samples_by_can = config.samples_by_can,
              .node = config.node,
              .code = config.loop.controller.code,
              .supervisor_period_s = config.supervisor.period_s,
              .force_reference_n = config.force_reference_n,
              .force_limit_n = config.force_limit_n,
              .sample_period_ns = config.sample_period_ns},
      loop_(ControlLoop::make_checked(config.loop)),
      supervisor_(*Supervisor::make(config.supervisor)),
      assembler_(*hal::can::SampleAssembler::make(config.assembler)),
      link_(config.node),
      report_(config.node) {
  supervision_.override_pct = loop_.command().override_pct;
}

auto Board::Config::check() const noexcept -> std::expected<void, ConfigError> {
  if (!loop.check()) return std::unexpected{ConfigError::kLoop};
  if (!supervisor.check()) return std::unexpected{ConfigError::kSupervisor};
  if (!assembler.check() || sample_period_ns <= 0) return std::unexpected{ConfigError::kAssembler};
  if (node < 1 || node > 127) return std::unexpected{ConfigError::kNode};
  const bool limited = force_limit_n > 0.0F;
  if (!(force_limit_n >= 0.0F) || (limited && !(force_limit_n > force_reference_n)))
    return std::unexpected{ConfigError::kForceLimit};
  return {};
}

auto Board::make(const Config& config) noexcept -> std::expected<Board, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return Board{config};
}

auto Board::receive(const hal::can::Frame& frame, std::int64_t now_ns) noexcept
    -> std::optional<LoopOutput> {
  if (config_.samples_by_can && !frame.own) {
    if (frame.id == identifier(Base::kPhases, config_.node)) {
      const auto phases = hal::can::unpack<hal::can::Phases>(frame);
      const auto taken = phases ? assembler_.take(*phases, now_ns) : std::nullopt;
      if (!taken) return std::nullopt;
      return run_loop(*taken, now_ns);
    }
    if (frame.id == identifier(Base::kSpindle, config_.node)) {
      if (const auto spindle = hal::can::unpack<hal::can::Spindle>(frame))
        assembler_.take(*spindle);
      return std::nullopt;
    }
  }
  link_.take(frame);
  return std::nullopt;
}

auto Board::sample(const hal::Sample& sample, std::int64_t now_ns) noexcept
    -> std::optional<LoopOutput> {
  return run_loop(with_third_phase(sample), now_ns);
}

auto Board::run_loop(hal::Sample sample, std::int64_t now_ns) noexcept
    -> std::optional<LoopOutput> {
  note_rate(now_ns);
  note_turning(sample);
  link_.add_to(sample);
  loop_.permit(permission());
  std::optional<LoopOutput> output = loop_.step(sample);
  if (!output) return std::nullopt;
  own_.supervised_ns = std::max(own_.supervised_ns, now_ns);
  note_wear(*output);
  supervise(&*output);
  output->override_pct = static_cast<float>(supervision_.override_pct);
  output->present |= LoopOutput::kOverride;
  own_.last = *output;
  return output;
}

// The rate by the board's own clock, over windows; what is not a whole window says nothing.
void Board::note_rate(std::int64_t now_ns) noexcept {
  ++own_.rate_count;
  const std::int64_t window_ns = now_ns - own_.rate_since_ns;
  if (own_.rate_since_ns != 0 && window_ns < kRateWindow_ns) return;
  // The sample that opens a window is not in it.
  own_.rate_hz = own_.rate_since_ns != 0 && window_ns < 2 * kRateWindow_ns
                     ? static_cast<float>(own_.rate_count) * 1e9F / static_cast<float>(window_ns)
                     : 0.0F;
  own_.rate_since_ns = now_ns;
  own_.rate_count = 0;
}

void Board::note_wear(const LoopOutput& output) noexcept {
  const std::uint32_t tool = link_.state().machine ? link_.state().machine->tool : 0U;
  if (tool != own_.tool) {
    own_.tool = tool;
    own_.first_gain_n_pct = 0.0F;
  }
  if ((output.present & LoopOutput::kProcessGain) != 0 && own_.first_gain_n_pct <= 0.0F) {
    own_.first_gain_n_pct = output.process_gain_n_pct;
  }
}

// Tapping turns the spindle back: the force law does not hold for it. Until the board is armed, any
// way is right.
void Board::note_turning(const hal::Sample& sample) noexcept {
  const bool armed = supervision_.state >= SupervisorState::kMonitor;
  if (!armed) {
    own_.turning = 0.0F;
    own_.reversed = 0;
  }
  if (!sample.has(hal::Signal::kSpeed)) return;
  const float speed_rad_s = sample.speed_rad_s;
  if (!(speed_rad_s > kTurning_rad_s || speed_rad_s < -kTurning_rad_s)) return;
  const float way = speed_rad_s > 0.0F ? 1.0F : -1.0F;
  if (own_.turning * way >= 0.0F) {
    own_.turning = way;
    own_.reversed = 0;
  } else {
    own_.reversed = 1;
  }
}

// Long enough that a reset finds the other node gone, and not just between two of its frames.
void Board::note_foreign() noexcept {
  if (link_.fetch_foreign()) {
    own_.foreign_steps =
        static_cast<std::uint32_t>(kForeignMemory_s / config_.supervisor_period_s) + 1;
  } else if (own_.foreign_steps > 0) {
    --own_.foreign_steps;
  }
}

// The sample rate is known after a window of it, and wrong if there is none after some.
bool Board::checks_done() const noexcept {
  return !own_.health.ports_open || own_.rate_hz > 0.0F ||
         own_.now_ns - own_.began_ns > 4 * kRateWindow_ns;
}

bool Board::checks_passed() const noexcept {
  if (!own_.health.ports_open || (own_.health.has_bus && is_down(own_.health.bus))) return false;
  const float expected_hz = 1e9F / static_cast<float>(config_.sample_period_ns);
  return own_.rate_hz > (1.0F - kRateTolerance_ratio) * expected_hz &&
         own_.rate_hz < (1.0F + kRateTolerance_ratio) * expected_hz;
}

float Board::force_limit_n() const noexcept {
  const auto& job = link_.state().job;
  const float reference_n =
      job && job->force_reference_n ? *job->force_reference_n : config_.force_reference_n;
  if (job && job->force_limit_ratio) {
    const float wanted_n = *job->force_limit_ratio * reference_n;
    // The machine's own limit is never lifted from outside.
    return config_.force_limit_n > 0.0F ? std::min(wanted_n, config_.force_limit_n) : wanted_n;
  }
  return config_.force_limit_n;
}

control::Permission Board::permission() const noexcept {
  control::Permission permission = supervision_.permission;
  if (const auto& job = link_.state().job) {
    if (job->force_reference_n) permission.force_reference_n = *job->force_reference_n;
    if (job->floor_pct) {
      permission.floor_pct = std::max(permission.floor_pct, static_cast<float>(*job->floor_pct));
    }
    if (job->ceiling_pct) {
      permission.ceiling_pct =
          std::min(permission.ceiling_pct, static_cast<float>(*job->ceiling_pct));
    }
  }
  return permission;
}

void Board::supervise(const LoopOutput* output) noexcept {
  note_foreign();
  const CncLink::State& cnc = link_.state();
  const hal::can::MachineState said = cnc.machine.value_or(hal::can::MachineState{});
  const bool has_force =
      output != nullptr && !output->doubtful && (output->present & LoopOutput::kCuttingForce) != 0;
  if (output != nullptr) own_.signals_refused = output->state == LoopState::kRefused ? 1U : 0U;
  supervision_ = supervisor_.step({.self_test_done = own_.health.self_test_done,
                                   .self_test_passed = own_.health.self_test_passed,
                                   .checks_passed = checks_passed(),
                                   .checks_done = checks_done(),
                                   .output_failed = own_.health.output_failed,
                                   .foreign = own_.foreign_steps > 0,
                                   .stop = own_.health.stop,
                                   .bus_down = own_.health.has_bus && is_down(own_.health.bus),
                                   .inhibit = own_.health.lines.inhibit,
                                   .threading = said.threading,
                                   .signals_refused = own_.signals_refused != 0,
                                   .reversed = own_.reversed != 0,
                                   .arm = said.arm,
                                   .control = said.control,
                                   .reset = said.reset,
                                   .spindle_at_speed = said.spindle_at_speed,
                                   .feeding = said.cutting_feed || said.rapid,
                                   .machine_state_new = link_.fetch_new(),
                                   .sample_new = output != nullptr,
                                   .force_new = has_force,
                                   .missed_ticks = own_.health.missed_ticks,
                                   .force_n = has_force ? output->cutting_force_n : 0.0F,
                                   .force_limit_n = force_limit_n(),
                                   .override_pct = loop_.command().override_pct});
  own_.health.missed_ticks = 0;
}

// What must not wait for the next sample.
bool Board::stopping(const BoardHealth& health) const noexcept {
  const bool down = health.has_bus && is_down(health.bus);
  const bool was_down = own_.health.has_bus && is_down(own_.health.bus);
  return (health.stop && !own_.health.stop) ||
         (health.output_failed && !own_.health.output_failed) || (down && !was_down);
}

// The end is the one silence that is announced, so that the CNC need not guess.
bool Board::may_speak() const noexcept {
  if (!supervision_.silent) return true;
  const bool down = own_.health.has_bus && is_down(own_.health.bus);
  return supervision_.state == SupervisorState::kDead && !down && !report_.has_told(values());
}

auto Board::tick(std::int64_t now_ns, const BoardHealth& health) noexcept -> BoardOutput {
  const std::uint32_t missed = own_.health.missed_ticks + health.missed_ticks;
  const bool at_once = stopping(health);
  own_.health = health;
  own_.health.missed_ticks = missed;
  own_.lost_samples += health.lost_samples;
  if (own_.started == 0) {
    own_.started = 1;
    own_.supervised_ns = own_.began_ns = own_.now_ns = now_ns;
  }
  const auto step_ns = static_cast<std::int64_t>(config_.supervisor_period_s * 1e9F + 0.5F);
  if (at_once) supervise(nullptr);
  if (now_ns - own_.supervised_ns > kSilence_ns) {
    std::int64_t steps = (now_ns - own_.supervised_ns - kSilence_ns) / step_ns;
    own_.supervised_ns += steps * step_ns;
    for (steps = std::min(steps, kMostClockSteps); steps > 0; --steps) supervise(nullptr);
  }
  own_.now_ns = now_ns;

  BoardOutput out{};
  out.supervision = supervision_;
  if (may_speak()) out.frame = report_.due(now_ns, values());
  if (!supervision_.alive) {
    own_.alive = 0;
    own_.alive_ns = now_ns;
  } else if (now_ns - own_.alive_ns >= kAliveHalfPeriod_ns) {
    own_.alive ^= 1U;
    own_.alive_ns = now_ns;
  }
  out.byte = {
      .byte = byte(), .alive = own_.alive != 0, .alarm = supervision_.alarm, .again = false};
  return out;
}

BoardValues Board::values() const noexcept {
  const LoopOutput& last = own_.last;
  const auto value = [&last](LoopOutput::Value which, float number) {
    return (last.present & which) != 0 ? std::optional<float>{number} : std::nullopt;
  };
  const auto force_n = value(LoopOutput::kCuttingForce, last.cutting_force_n);
  const auto gain = value(LoopOutput::kProcessGain, last.process_gain_n_pct);
  const auto wear = gain && own_.first_gain_n_pct > 0.0F
                        ? std::optional<float>{*gain / own_.first_gain_n_pct}
                        : std::nullopt;
  const auto state = static_cast<std::uint8_t>(supervision_.state);
  const auto reason = static_cast<std::uint8_t>(supervision_.reason);
  const float reference_n = permission().force_reference_n;
  const float limit_n = force_limit_n();
  return {
      .override = {.override_pct = supervision_.override_pct,
                   .state = state,
                   .reason = reason,
                   .force_n = force_n,
                   .enabled =
                       supervision_.controlling || supervision_.state >= SupervisorState::kLinkLost,
                   .saturated_low = supervision_.controlling && last.saturated_low,
                   .saturated_high = supervision_.controlling && last.saturated_high,
                   .in_cut = last.state == LoopState::kCut,
                   .source = static_cast<std::uint8_t>(last.source),
                   .limit = limit_n > 0.0F && force_n.value_or(0.0F) > limit_n},
      .estimate = {.force_n = force_n,
                   .force_sigma_n = value(LoopOutput::kCuttingForce, last.cutting_force_sigma_n),
                   .reference_n = reference_n > 0.0F ? reference_n : config_.force_reference_n,
                   .power_w = value(LoopOutput::kAirGapPower, last.airgap_power_w),
                   .stability_margin_ratio =
                       value(LoopOutput::kStabilityMargin, last.stability_margin_ratio)},
      .diagnostics = {.process_gain_n_pct = gain,
                      .wear_ratio = wear,
                      .worst_loop_us = own_.health.worst_loop_us,
                      .refused_frames = link_.state().refused,
                      .unsent_frames = own_.health.bus.unsent,
                      .lost_samples = own_.lost_samples + assembler_.state().lost},
      .state = state,
      .reason = reason};
}

}  // namespace cutforce::firmware
