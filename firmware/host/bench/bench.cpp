#include "firmware/host/bench/bench.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace cutforce::firmware::host {
namespace {

// A machine that cuts at 0.2 m/min for ever, where there is no lathe.
constexpr BenchLathe::Machine kSteadyMachine{.spindle_at_speed = true,
                                             .cutting_feed = true,
                                             .part_start = false,
                                             .override_applied_pct = 100,
                                             .feed_m_s = 0.2F / 60.0F,
                                             .diameter_m = 0.0F};
constexpr float kDiameterStep_m = 0.5e-3F;  // of the frame

}  // namespace

std::expected<Bench, InputError> Bench::make(const Config& config,
                                             std::optional<BenchLathe> lathe) {
  if (config.node < 1 || config.node > 127) {
    return std::unexpected{InputError{"--node", "there is no node " + std::to_string(config.node),
                                      "give the board's node id, 1..127"}};
  }
  const std::int64_t period_ns = lathe ? lathe->period_ns() : kPlainPeriod_ns;
  auto cnc = CncModel::make(config.cnc);
  if (!cnc || config.cnc.scan_ns % period_ns != 0) {
    const bool timeout = !cnc && cnc.error() == CncModel::ConfigError::kTimeout;
    return std::unexpected{timeout ? InputError{"--timeout", "it is shorter than the CNC's scan",
                                                "give more than --latency, usually 250"}
                                   : InputError{"--latency", "it is not whole sample periods",
                                                "give whole milliseconds, at least 1"}};
  }
  return Bench{config, *cnc, std::move(lathe)};
}

Bench::Bench(const Config& config, CncModel cnc, std::optional<BenchLathe> lathe)
    : config_(config),
      cnc_(cnc),
      lathe_(std::move(lathe)),
      listener_(config.node),
      period_ns_(lathe_ ? lathe_->period_ns() : kPlainPeriod_ns),
      waiting_(config.wait_for_board) {}

void Bench::receive(const LineEvent& event) noexcept {
  switch (event.kind) {
    case LineEvent::Kind::kByte:
      ++lines_.bytes;
      lines_.byte = event.value;
      lines_.override_pct = control::decode(config_.code, event.value);
      if (!lines_.override_pct) ++lines_.invalid;
      lines_.is_new = lines_.is_new || !config_.has_alive;
      return;
    case LineEvent::Kind::kAlive:
      ++lines_.alive_edges;
      lines_.is_new = true;
      return;
    case LineEvent::Kind::kAlarm:
      if (event.value != 0 && !lines_.alarm) ++lines_.alarms;
      lines_.alarm = event.value != 0;
      return;
  }
}

std::size_t Bench::step(std::span<hal::can::Frame, kMostFrames> frames) noexcept {
  const BenchLathe::Machine machine = lathe_ ? lathe_->machine() : kSteadyMachine;
  if (waiting_) {
    const bool heard =
        listener_.state().heartbeat || listener_.state().override || heard_by_lines();
    waiting_ = !heard || clock_ns_ % kMachineStateCycle_ns != 0;
    if (!waiting_) machine_state_ns_ = job_ns_ = 0;
  }
  const CncModel::Output cnc =
      waiting_ ? CncModel::Output{CncState::kWaiting, 100, false, false, false} : step_cnc(machine);
  row_ = {.time_ns = now_ns_,
          .cnc = cnc,
          .waiting = waiting_,
          .has_truth = lathe_.has_value() && !waiting_,
          .truth = lathe_ ? lathe_->truth() : hal::host::MachineTruth{}};
  std::size_t count = 0;
  const std::int64_t cycle_ns = waiting_ ? clock_ns_ : now_ns_;
  if (cycle_ns >= machine_state_ns_) {
    machine_state_ns_ += kMachineStateCycle_ns;
    frames[count++] = machine_state(machine, cnc);
    if (job_due(machine, cycle_ns)) {
      frames[count++] = hal::can::pack(config_.job, config_.node, job_counter_++);
    }
  }
  clock_ns_ += period_ns_;
  if (waiting_) return count;
  now_ns_ += period_ns_;
  if (lathe_) {
    const BenchLathe::Frames signals = lathe_->advance(cnc.override_pct);
    for (std::size_t k = 0; k < signals.count; ++k) frames[count++] = signals.frames[k];
  }
  return count;
}

CncModel::Output Bench::step_cnc(const BenchLathe::Machine& machine) noexcept {
  const bool by_lines = config_.by_lines;
  const auto& heard = listener_.state().override;
  const bool is_new = by_lines ? std::exchange(lines_.is_new, false) : listener_.fetch_new();
  const auto by_frame = heard ? heard->override_pct : std::nullopt;
  return cnc_.step({.now_ns = now_ns_,
                    .is_new = is_new,
                    .override_pct = by_lines ? lines_.override_pct : by_frame,
                    .board_state = heard ? std::optional{heard->state} : std::nullopt,
                    .spindle_at_speed = machine.spindle_at_speed});
}

bool Bench::job_due(const BenchLathe::Machine& machine, std::int64_t cycle_ns) noexcept {
  const float last_m = config_.job.diameter_m.value_or(0.0F);
  if (machine.diameter_m > 0.0F && std::abs(machine.diameter_m - last_m) >= kDiameterStep_m) {
    config_.job.diameter_m = machine.diameter_m;
    job_repeats_ = hal::can::GuardReceiver::kTrust;
  }
  if (job_repeats_ > 0) {
    --job_repeats_;
  } else if (cycle_ns < job_ns_) {
    return false;
  }
  job_ns_ = cycle_ns + kJobCycle_ns;
  return true;
}

hal::can::Frame Bench::machine_state(const BenchLathe::Machine& machine,
                                     const CncModel::Output& cnc) noexcept {
  const std::uint8_t applied =
      lathe_ ? machine.override_applied_pct : std::min<std::uint8_t>(cnc.override_pct, 254);
  return hal::can::pack(hal::can::MachineState{.arm = cnc.arm && !leaving_,
                                               .control = cnc.control && !leaving_,
                                               .reset = cnc.reset && !leaving_,
                                               .spindle_at_speed = machine.spindle_at_speed,
                                               .cutting_feed = machine.cutting_feed,
                                               .rapid = false,
                                               .threading = config_.threading,
                                               .part_start = machine.part_start,
                                               .tool = config_.tool,
                                               .override_applied_pct = applied,
                                               .feed_m_s = machine.feed_m_s},
                        config_.node, machine_state_counter_++);
}

}  // namespace cutforce::firmware::host
