#include "firmware/host/run/simulated_run.hpp"

#include <string>
#include <utility>

#include "firmware/host/run/recorded_machine.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::Signal;
using hal::host::bit;
using hal::host::TruthSignal;

constexpr std::uint32_t kTruths = bit(TruthSignal::kAirGapTorque) | bit(TruthSignal::kLoadTorque) |
                                  bit(TruthSignal::kCuttingTorque) |
                                  bit(TruthSignal::kCuttingForce);

hal::host::Truth truth_of(const hal::host::MachineTruth& truth) {
  return {.airgap_torque_nm = static_cast<float>(truth.airgap_torque_nm),
          .load_torque_nm = static_cast<float>(truth.load_torque_nm),
          .cutting_torque_nm = static_cast<float>(truth.cutting_torque_nm),
          .cutting_force_n = static_cast<float>(truth.cutting_force_n),
          .drive_airgap_torque_nm = 0.0F,
          .present = kTruths};
}

std::string voltage_text(const hal::host::SimulatedMachineConfig& simulation) {
  const std::string inverter = simulation.inverter.switched ? "PWM inverter" : "averaged inverter";
  switch (simulation.sensors.voltage_signal) {
    case hal::host::VoltageSignal::kMean:
      return inverter + ", mean over a hold centred on the sample";
    case hal::host::VoltageSignal::kReference:
      return inverter + ", the drive's reference";
    case hal::host::VoltageSignal::kInstantaneous:
      break;
  }
  return inverter + (simulation.inverter.anti_alias_hz > 0.0 ? ", behind equal anti-alias filters"
                                                             : ", raw samples");
}

}  // namespace

hal::host::RecordingLayout layout_of(const Scenario& scenario) {
  const auto& simulation = scenario.simulation;
  const auto& sensors = simulation.sensors;
  std::uint32_t signals = 0;
  const auto add = [&signals](bool there, Signal signal) {
    if (there) signals |= hal::bit(signal);
  };
  add(sensors.current_w_present, Signal::kCurrentW);
  add(sensors.speed.present, Signal::kSpeed);
  add(sensors.power_meter.present, Signal::kPowerMeter);
  add(sensors.dynamometer.present, Signal::kMeasuredForce);
  add(sensors.feed_active_present, Signal::kFeedActive);
  add(sensors.override_applied_present, Signal::kOverrideApplied);
  add(sensors.diameter_present, Signal::kWorkpieceDiameter);
  add(sensors.feed_rate_present, Signal::kFeedRate);
  const bool vhz = simulation.drive.control == hal::host::DriveControl::kVoltsPerHertz;
  std::vector<hal::host::Metadata> metadata{{"source", "cutforce simulate, " + scenario.title, 0},
                                            {"seed", std::to_string(simulation.seed), 0},
                                            {"drive", vhz ? "vhz" : "vector", 0},
                                            {"voltage", voltage_text(simulation), 0}};
  for (auto& entry : machine_metadata(scenario.machine)) metadata.push_back(std::move(entry));
  return {.metadata = std::move(metadata),
          .voltage_kind = sensors.voltage_kind,
          .signals = signals,
          .truths = kTruths};
}

RecordedSimulation::RecordedSimulation(hal::host::SimulatedMachine& machine,
                                       double control_period_s, double duration_s,
                                       hal::host::RecordingWriter& writer, Watcher watcher)
    : machine_(machine),
      port_(machine, control_period_s, duration_s),
      writer_(writer),
      watcher_(std::move(watcher)),
      progress_("simulate", "s", duration_s) {}

std::expected<std::size_t, hal::PortError> RecordedSimulation::read(std::span<hal::Sample> block) {
  const auto count = port_.read(block.first(1));
  if (!count || *count == 0) return count;
  const hal::host::Truth truth = truth_of(machine_.truth());
  if (auto written = writer_.write(block.first(1), std::span(&truth, 1)); !written) {
    error_ = written.error();
    return std::unexpected{hal::PortError::kSystem};
  }
  if (watcher_) watcher_(block.front());
  ++samples_;
  progress_.update(static_cast<double>(block.front().time_ns) * 1e-9);
  return count;
}

std::expected<void, hal::PortError> RecordedSimulation::write(const hal::Command& command) {
  return port_.write(command);
}

}  // namespace cutforce::firmware::host
