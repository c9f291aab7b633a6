#include "firmware/host/run/simulated_run.hpp"

#include <string>
#include <utility>

#include "firmware/host/number_text.hpp"
#include "firmware/host/run/recorded_machine.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::Signal;
using hal::host::bit;
using hal::host::TruthSignal;

constexpr std::uint32_t kTruths = bit(TruthSignal::kAirGapTorque) | bit(TruthSignal::kLoadTorque) |
                                  bit(TruthSignal::kCuttingTorque) |
                                  bit(TruthSignal::kCuttingForce);

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

std::vector<hal::host::Metadata> metadata_of(const Scenario& scenario, std::uint64_t seed,
                                             std::vector<hal::host::Metadata> more) {
  std::vector<hal::host::Metadata> metadata{{"source", "cutforce simulate, " + scenario.title, 0},
                                            {"seed", std::to_string(seed), 0}};
  for (auto& entry : more) metadata.push_back(std::move(entry));
  for (auto& entry : machine_metadata(scenario.machine)) metadata.push_back(std::move(entry));
  return metadata;
}

hal::host::RecordingLayout motor_layout(const Scenario& scenario) {
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
  return {.metadata = metadata_of(
              scenario, simulation.seed,
              {{"drive", vhz ? "vhz" : "vector", 0}, {"voltage", voltage_text(simulation), 0}}),
          .voltage_kind = sensors.voltage_kind,
          .signals = signals,
          .truths = kTruths};
}

// A recording has columns for voltages and currents always; here they stay empty.
hal::host::RecordingLayout force_layout(const Scenario& scenario) {
  const auto& force = scenario.force;
  std::uint32_t signals = hal::bit(Signal::kMeasuredForce);
  if (force.speed_present) signals |= hal::bit(Signal::kSpeed);
  if (force.override_applied_present) signals |= hal::bit(Signal::kOverrideApplied);
  return {.metadata =
              metadata_of(scenario, force.seed,
                          {{"sample_rate_hz", number_text(scenario.machine.sample_rate_hz), 0}}),
          .voltage_kind = hal::host::VoltageKind::kLineToNeutral,
          .signals = signals,
          .truths = bit(TruthSignal::kCuttingForce)};
}

}  // namespace

hal::host::Truth recorded_truth(const hal::host::MachineTruth& truth) noexcept {
  return {.airgap_torque_nm = static_cast<float>(truth.airgap_torque_nm),
          .load_torque_nm = static_cast<float>(truth.load_torque_nm),
          .cutting_torque_nm = static_cast<float>(truth.cutting_torque_nm),
          .cutting_force_n = static_cast<float>(truth.cutting_force_n),
          .drive_airgap_torque_nm = 0.0F,
          .present = kTruths};
}

hal::host::RecordingLayout layout_of(const Scenario& scenario) {
  return scenario.model == Model::kForce ? force_layout(scenario) : motor_layout(scenario);
}

}  // namespace cutforce::firmware::host
