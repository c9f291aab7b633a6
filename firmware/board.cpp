#include "firmware/board.hpp"

#include <algorithm>

namespace cutforce::firmware {
namespace {

using control::SupervisorState;
using hal::can::Base;
using hal::can::identifier;

constexpr std::int64_t kRateWindow_ns = 500'000'000;
// A rate that is wrong in the machine file is wrong by a factor; the board's clock is jittery.
constexpr float kRateTolerance_ratio = 0.1F;
constexpr float kTurning_rad_s = 1.0F;  // slower is standing still, and noise
constexpr int kMostClockSteps = 100;    // after a stall; the rest of the time is forgotten

// Two voltages of three sum to minus the third: exactly between the lines, and to the neutral of a
// motor with three wires but for what drives no current.
void add_third_phase(hal::Sample& sample) noexcept {
  using hal::Signal;
  constexpr std::uint32_t kTwo = hal::bit(Signal::kVoltageU) | hal::bit(Signal::kVoltageV);
  constexpr std::uint32_t kThird = hal::bit(Signal::kVoltageW);
  if ((sample.present & (kTwo | kThird)) != kTwo) return;
  sample.voltage_v[2] = -(sample.voltage_v[0] + sample.voltage_v[1]);
  sample.present |= kThird;
}

}  // namespace

auto Board::make(const Config& config) noexcept -> std::expected<Board, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return Board{config};
}

// Apart, so that the frame's values are not on the stack below the loop.
[[gnu::noinline]] auto Board::sample_in(const hal::can::Frame& frame, std::int64_t now_ns) noexcept
    -> std::optional<hal::Sample> {
  const auto phases = hal::can::unpack<hal::can::Phases>(frame);
  return phases ? assembler_.take(*phases, now_ns) : std::nullopt;
}

auto Board::receive(const hal::can::Frame& frame, std::int64_t now_ns) noexcept
    -> const LoopOutput* {
  if (config_.samples_by_can && !frame.own) {
    if (frame.id == identifier(Base::kPhases, config_.node)) {
      auto taken = sample_in(frame, now_ns);
      if (!taken) return nullptr;
      complete({&*taken, 1}, now_ns);
      std::span<const hal::Sample> one(&*taken, 1);
      return step(one, now_ns);
    }
    if (frame.id == identifier(Base::kSpindle, config_.node)) {
      if (const auto spindle = hal::can::unpack<hal::can::Spindle>(frame))
        assembler_.take(*spindle);
      return nullptr;
    }
  }
  link_.take(frame);
  return nullptr;
}

// What the bus and the board know of the samples, into each of them.
void Board::complete(std::span<hal::Sample> samples, std::int64_t now_ns) noexcept {
  note_rate(static_cast<std::uint32_t>(samples.size()), now_ns);
  for (hal::Sample& sample : samples) add_third_phase(sample);
  note_turning(samples.back());
  link_.add_to(samples);
}

auto Board::step(std::span<const hal::Sample>& samples, std::int64_t now_ns) noexcept
    -> const LoopOutput* {
  loop_.permit(permission());
  if (!loop_.step(samples, own_.last)) return nullptr;
  own_.supervised_ns = std::max(own_.supervised_ns, now_ns);
  note_wear(own_.last);
  supervise(&own_.last);
  own_.last.override_pct = static_cast<float>(supervision_.override_pct);
  own_.last.present |= LoopOutput::kOverride;
  return &own_.last;
}

// The rate by the board's own clock, over windows; what is not a whole window says nothing.
void Board::note_rate(std::uint32_t count, std::int64_t now_ns) noexcept {
  const std::int64_t window_ns = now_ns - own_.rate_since_ns;
  if (own_.rate_since_ns != 0 && window_ns < kRateWindow_ns) {
    own_.rate_count += count;
    return;
  }
  // The sample that opens a window is not in it.
  const std::uint32_t counted = own_.rate_count + 1;
  own_.rate_hz = own_.rate_since_ns != 0 && window_ns < 2 * kRateWindow_ns
                     ? static_cast<float>(counted) * 1e9F / static_cast<float>(window_ns)
                     : 0.0F;
  own_.rate_since_ns = now_ns;
  own_.rate_count = count - 1;
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
// way is right. The last sample of a block speaks for it.
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
  const float expected_hz = config_.sample_rate_hz;
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
  return supervision_.state == SupervisorState::kDead && !down && !report_.has_told(headline());
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
  if (at_once) supervise(nullptr);
  std::int64_t behind_ns = now_ns - own_.supervised_ns - kSilence_ns;
  for (int steps = 0; behind_ns >= config_.supervisor_step_ns; ++steps) {
    behind_ns = steps < kMostClockSteps ? behind_ns - config_.supervisor_step_ns : 0;
    own_.supervised_ns = now_ns - kSilence_ns - behind_ns;
    if (steps < kMostClockSteps) supervise(nullptr);
  }
  own_.now_ns = now_ns;

  if (!supervision_.alive) {
    own_.alive = 0;
    own_.alive_ns = now_ns;
  } else if (now_ns - own_.alive_ns >= kAliveHalfPeriod_ns) {
    own_.alive ^= 1U;
    own_.alive_ns = now_ns;
  }
  return {.frame = may_speak() ? frame(report_.due(now_ns, headline())) : std::nullopt,
          .byte = {.byte = byte(),
                   .alive = own_.alive != 0,
                   .alarm = supervision_.alarm,
                   .again = false},
          .supervision = supervision_};
}

}  // namespace cutforce::firmware
