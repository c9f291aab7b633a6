// The simulated machine as a port that records what it delivers, for simulate.hpp alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <functional>
#include <optional>
#include <span>

#include "firmware/host/commands/progress.hpp"
#include "firmware/host/scenario/scenario.hpp"
#include "hal/host/recording_writer.hpp"
#include "hal/host/simulation/simulation_port.hpp"

namespace cutforce::firmware::host {

// What the recording of a scenario is to hold.
[[nodiscard]] hal::host::RecordingLayout layout_of(const Scenario& scenario);

// One sample at a read: its truth is the machine's own only until the next.
class RecordedSimulation {
 public:
  using Watcher = std::function<void(const hal::Sample&)>;

  RecordedSimulation(hal::host::SimulatedMachine& machine, double control_period_s,
                     double duration_s, hal::host::RecordingWriter& writer, Watcher watcher);

  // Fails with kSystem iff the recording cannot be written; error() says why. Throws Stopped.
  [[nodiscard]] std::expected<std::size_t, hal::PortError> read(std::span<hal::Sample> block);
  [[nodiscard]] std::expected<void, hal::PortError> write(const hal::Command& command);

  [[nodiscard]] const std::optional<hal::host::InputError>& error() const noexcept {
    return error_;
  }
  [[nodiscard]] std::uint64_t samples() const noexcept { return samples_; }

 private:
  hal::host::SimulatedMachine& machine_;
  hal::host::SimulationPort port_;
  hal::host::RecordingWriter& writer_;
  Watcher watcher_;
  Progress progress_;
  std::optional<hal::host::InputError> error_;
  std::uint64_t samples_ = 0;
};

static_assert(hal::Port<RecordedSimulation>);

}  // namespace cutforce::firmware::host
