// A simulated machine as a port that records what it delivers, for simulate.hpp alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <functional>
#include <optional>
#include <span>
#include <utility>

#include "firmware/host/commands/progress.hpp"
#include "firmware/host/scenario/scenario.hpp"
#include "hal/host/recording_writer.hpp"
#include "hal/host/simulation/force_machine_port.hpp"
#include "hal/host/simulation/simulation_port.hpp"

namespace cutforce::firmware::host {

// What the recording of a scenario is to hold.
[[nodiscard]] hal::host::RecordingLayout layout_of(const Scenario& scenario);
// All that a row may hold of the truth; the layout picks.
[[nodiscard]] hal::host::Truth recorded_truth(const hal::host::MachineTruth& truth) noexcept;

// Around a simulation's port. One sample at a read: its truth is the port's own only until the
// next.
template <class Simulated>
class RecordedSimulation {
 public:
  using Watcher = std::function<void(const hal::Sample&)>;

  RecordedSimulation(Simulated& port, double duration_s, hal::host::RecordingWriter& writer,
                     Watcher watcher)
      : port_(port),
        writer_(writer),
        watcher_(std::move(watcher)),
        progress_("simulate", "s", duration_s) {}

  // Fails with kSystem iff the recording cannot be written; error() says why. Throws Stopped.
  [[nodiscard]] std::expected<std::size_t, hal::PortError> read(std::span<hal::Sample> block) {
    const auto count = port_.read(block.first(1));
    if (!count || *count == 0) return count;
    const hal::host::Truth truth = recorded_truth(port_.truth());
    if (auto written = writer_.write(block.first(1), std::span(&truth, 1)); !written) {
      error_ = written.error();
      return std::unexpected{hal::PortError::kSystem};
    }
    if (watcher_) watcher_(block.front());
    ++samples_;
    progress_.update(static_cast<double>(block.front().time_ns) * 1e-9);
    return count;
  }
  [[nodiscard]] std::expected<void, hal::PortError> write(const hal::Command& command) {
    return port_.write(command);
  }

  [[nodiscard]] const std::optional<hal::host::InputError>& error() const noexcept {
    return error_;
  }
  [[nodiscard]] std::uint64_t samples() const noexcept { return samples_; }

 private:
  Simulated& port_;
  hal::host::RecordingWriter& writer_;
  Watcher watcher_;
  Progress progress_;
  std::optional<hal::host::InputError> error_;
  std::uint64_t samples_ = 0;
};

static_assert(hal::Port<RecordedSimulation<hal::host::SimulationPort>>);
static_assert(hal::Port<RecordedSimulation<hal::host::ForceMachinePort>>);

}  // namespace cutforce::firmware::host
