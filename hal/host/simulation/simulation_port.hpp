// The simulated machine behind hal::Port.
// A read never crosses the end of a control period: the sample before a boundary and the one on
// or after it each end a block. So whichever of them the loop takes for its tick, its command is
// on the wire before the machine moves on, and the loop closes strictly.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>

#include "hal/host/simulation/simulated_machine.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::host {

class SimulationPort {
 public:
  // control_period_s <= 0: one sample at a time. Samples after duration_s are not delivered.
  SimulationPort(SimulatedMachine& machine, double control_period_s, double duration_s) noexcept;

  [[nodiscard]] std::expected<std::size_t, PortError> read(std::span<Sample> block) noexcept;
  [[nodiscard]] std::expected<void, PortError> write(const Command& command) noexcept;

  [[nodiscard]] const Command& last_command() const noexcept { return last_; }
  // Of the last sample.
  [[nodiscard]] MachineTruth truth() const noexcept { return machine_->truth(); }

 private:
  [[nodiscard]] std::int64_t period_of(std::int64_t time_ns) const noexcept;

  SimulatedMachine* machine_;
  std::int64_t control_period_ns_;
  std::int64_t sample_period_ns_;
  std::int64_t end_ns_;
  std::int64_t last_time_ns_ = -1;
  Command last_{};
};

static_assert(Port<SimulationPort>);

}  // namespace cutforce::hal::host
