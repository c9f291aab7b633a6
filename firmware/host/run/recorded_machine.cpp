#include "firmware/host/run/recorded_machine.hpp"

#include <cmath>

#include "firmware/host/number_text.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::Signal;

MachineFile begin(const MachineRequest& request) {
  if (request.machine_file.empty()) return {};
  return read_machine_file(request.machine_file);
}

void apply_options(MachineFile& file, const MachineRequest& request) {
  for (const MachineOption& option : request.options) {
    set_value(file, option.key, option.value, option.option);
  }
}

// What has a column is there, whatever the machine file believes.
void take_columns(MachineFile& file, const hal::host::RecordingInfo& info) {
  const auto has = [&info](Signal signal) { return (info.signals & hal::bit(signal)) != 0; };
  const auto set = [&](std::string_view key, std::string_view value) {
    set_value(file, key, value, info.file);
  };
  const bool lines = info.voltage_kind == hal::host::VoltageKind::kLineToLine;
  set("voltage_kind", lines ? "line_to_line" : "line_to_neutral");
  set("current_w_present", has(Signal::kCurrentW) ? "true" : "false");
  set("speed_present", has(Signal::kSpeed) ? "true" : "false");
  set("power_meter_present", has(Signal::kPowerMeter) ? "true" : "false");
  // Without a rotor's speed the estimator `computed` has the synchronous one.
  if (!has(Signal::kSpeed) && !file.is_given("speed_source")) {
    set_value(file, "speed_source", "synchronous", info.file);
  }
}

void take_sample_rate(MachineFile& file, const hal::host::RecordingInfo& info,
                      const hal::host::SamplePeriod& period, bool demanded) {
  const auto rate_hz = static_cast<float>(1.0 / period.period_s);
  if (!demanded) {
    // A declared rate is kept to the digit; a median of rounded time stamps is not that exact.
    const float rounded_hz = std::round(rate_hz);
    const bool whole = std::fabs(rate_hz / rounded_hz - 1.0F) < 1e-4F;
    set_value(file, "sample_rate_hz", number_text(whole ? rounded_hz : rate_hz), info.file);
    return;
  }
  if (std::fabs(file.machine.sample_rate_hz / rate_hz - 1.0F) < 0.01F) return;
  file.errors.push_back({file.where[*find_parameter("sample_rate_hz")],
                         "sample_rate_hz = " + number_text(file.machine.sample_rate_hz) +
                             ", but the recording's rows are " +
                             number_text(static_cast<float>(period.period_s)) + " s apart",
                         "leave sample_rate_hz out; a recording knows its own"});
}

std::string value_text(const Parameter& parameter, const Machine& machine) {
  if (parameter.kind == Kind::kFlag) return parameter.get(machine, 0) != 0.0F ? "true" : "false";
  if (parameter.kind == Kind::kChoice) {
    return std::string(parameter.names[static_cast<std::size_t>(parameter.get(machine, 0))]);
  }
  std::string text;
  for (std::size_t k = 0; k < parameter.size(); ++k) {
    text += (k > 0 ? ", " : "") + number_text(parameter.get(machine, k));
  }
  return text;
}

}  // namespace

std::expected<LoadedMachine, std::vector<InputError>> recorded_machine(
    const hal::host::RecordingInfo& info, const hal::host::SamplePeriod& period,
    const MachineRequest& request) {
  MachineFile file = begin(request);
  const bool demanded = file.is_given("sample_rate_hz");
  if (request.machine_file.empty()) file.name = info.file;
  const auto values = recorded_values(info.metadata);
  merge_metadata(file, values, info.file);
  take_columns(file, info);
  take_sample_rate(file, info, period, demanded);
  apply_options(file, request);
  return complete(std::move(file));
}

std::expected<LoadedMachine, std::vector<InputError>> requested_machine(
    const MachineRequest& request) {
  MachineFile file = begin(request);
  apply_options(file, request);
  // A dynamometer alone sends what the controller asks for, one force a tick.
  if (file.machine.estimator == EstimatorName::kDynamometer &&
      file.machine.sample_rate_hz == 0.0F && file.machine.control_period_s > 0.0F) {
    file.machine.sample_rate_hz = 1.0F / file.machine.control_period_s;
  }
  return complete(std::move(file));
}

std::vector<hal::host::Metadata> machine_metadata(const Machine& machine) {
  const Machine unspecified = unspecified_machine();
  std::vector<hal::host::Metadata> metadata;
  for (const Parameter& parameter : kParameters) {
    if (parameter.section > Section::kPowerMeter || parameter.says_nothing(machine)) continue;
    // Columns tell what is there.
    if (parameter.key == "voltage_kind" || parameter.key.ends_with("_present")) continue;
    bool same = true;
    for (std::size_t k = 0; k < parameter.size(); ++k) {
      same = same && parameter.get(machine, k) == parameter.get(unspecified, k);
    }
    const bool vital = parameter.key == "winding" || parameter.key == "pole_pairs";
    if (same && !vital) continue;
    metadata.push_back(
        {.key = std::string(parameter.key), .value = value_text(parameter, machine), .line = 0});
  }
  return metadata;
}

}  // namespace cutforce::firmware::host
