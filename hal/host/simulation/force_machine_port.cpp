#include "hal/host/simulation/force_machine_port.hpp"

#include <cmath>
#include <utility>

namespace cutforce::hal::host {

ForceMachinePort::ForceMachinePort(ForceMachine& machine, double duration_s, Watcher watcher)
    : machine_(machine),
      samples_left_(
          static_cast<std::uint64_t>(std::floor(duration_s / machine.config().sample_s + 1e-6)) +
          1),
      watcher_(std::move(watcher)) {}

std::expected<std::size_t, PortError> ForceMachinePort::read(std::span<Sample> block) {
  if (block.empty() || samples_left_ == 0) return 0;
  --samples_left_;
  for (std::uint32_t k = 0; started_ && k < machine_.steps_per_sample(); ++k) {
    machine_.step();
    if (watcher_) watcher_(machine_);
  }
  started_ = true;
  block.front() = machine_.read();
  return 1;
}

std::expected<void, PortError> ForceMachinePort::write(const Command& command) noexcept {
  machine_.set_override(static_cast<double>(command.override_pct));
  return {};
}

MachineTruth ForceMachinePort::truth() const noexcept {
  const ForceMachine::Truth truth = machine_.truth();
  MachineTruth all{};
  all.time_ns = static_cast<std::int64_t>(std::floor(truth.time_s * 1e9 + 0.5));
  all.cutting_force_n = truth.force_n;
  all.feed_m_s = truth.feed_m_s;
  all.depth_m = truth.depth_m;
  all.position_m = truth.position_m;
  all.override_pct = truth.override_pct;
  return all;
}

}  // namespace cutforce::hal::host
