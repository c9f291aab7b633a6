#include "hal/host/simulation/simulation_port.hpp"

#include <cmath>

namespace cutforce::hal::host {
namespace {

std::int64_t whole_ns(double time_s) noexcept {
  return static_cast<std::int64_t>(std::floor(time_s * 1e9 + 0.5));
}

}  // namespace

SimulationPort::SimulationPort(SimulatedMachine& machine, double control_period_s,
                               double duration_s) noexcept
    : machine_(&machine),
      control_period_ns_(control_period_s > 0.0 ? whole_ns(control_period_s) : 0),
      sample_period_ns_(whole_ns(1.0 / machine.config().sample_rate_hz)),
      end_ns_(whole_ns(duration_s)) {}

std::int64_t SimulationPort::period_of(std::int64_t time_ns) const noexcept {
  return time_ns / control_period_ns_;
}

std::expected<std::size_t, PortError> SimulationPort::read(std::span<Sample> block) noexcept {
  std::size_t count = 0;
  while (count < block.size()) {
    if (last_time_ns_ >= 0 && last_time_ns_ + sample_period_ns_ > end_ns_ + 1) break;
    block[count] = machine_->advance();
    const std::int64_t time_ns = block[count].time_ns;
    if (time_ns > end_ns_) break;  // the end lay in a gap
    const std::int64_t before_ns = last_time_ns_ < 0 ? time_ns : last_time_ns_;
    last_time_ns_ = time_ns;
    ++count;
    // A nanosecond of slack: sampling times are rounded, boundaries may be.
    if (control_period_ns_ == 0 || period_of(before_ns + 1) != period_of(time_ns + 1) ||
        period_of(time_ns + 1) != period_of(time_ns + sample_period_ns_ + 1)) {
      break;
    }
  }
  return count;
}

std::expected<void, PortError> SimulationPort::write(const Command& command) noexcept {
  last_ = command;
  machine_->set_override(static_cast<double>(command.override_pct));
  return {};
}

}  // namespace cutforce::hal::host
