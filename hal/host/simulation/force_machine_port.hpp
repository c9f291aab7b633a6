// The machine without its motor behind hal::Port: one sample a control period, so that the command
// which answers a sample is on the wire before the machine moves on.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <functional>
#include <span>

#include "hal/host/simulation/force_machine.hpp"
#include "hal/host/simulation/simulated_machine.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::host {

class ForceMachinePort {
 public:
  // Sees every step of the simulation, after it.
  using Watcher = std::function<void(const ForceMachine&)>;

  // Samples after duration_s are not delivered; a path that ends before leaves the tool at rest.
  ForceMachinePort(ForceMachine& machine, double duration_s, Watcher watcher = {});

  [[nodiscard]] std::expected<std::size_t, PortError> read(std::span<Sample> block);
  [[nodiscard]] std::expected<void, PortError> write(const Command& command) noexcept;

  // Of the last sample. What the model does not have is 0.
  [[nodiscard]] MachineTruth truth() const noexcept;

 private:
  ForceMachine& machine_;
  std::uint64_t samples_left_;
  Watcher watcher_;
  bool started_ = false;
};

static_assert(Port<ForceMachinePort>);

}  // namespace cutforce::hal::host
