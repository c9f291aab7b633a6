#include "support/loop_support.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "firmware/host/run/recorded_machine.hpp"
#include "firmware/host/trace_format.hpp"
#include "hal/host/simulation/simulation_port.hpp"
#include "hal/host/truth_reader.hpp"
#include "support/program.hpp"

namespace cutforce::host_tests {
namespace {

using firmware::ControlLoop;
using firmware::LoopOutput;
using firmware::Machine;

template <class Result>
auto sound(Result result, const std::string& what) {
  if (result) return std::move(*result);
  std::fprintf(stderr, "%s is not sound\n", what.c_str());
  std::abort();
}

}  // namespace

Recorded committed_recording(const std::string& name) {
  using hal::host::TruthReader;
  const auto path = in_tests("recordings/" + name + ".csv.gz");
  auto reader = sound(TruthReader::open(path), name);
  const auto period = sound(reader.sample_period(), name);
  const auto loaded = sound(firmware::host::recorded_machine(reader.info(), period, {}), name);
  Recorded recorded{.machine = loaded.machine, .samples = {}, .truth = {}};
  recorded.truth.rated_torque_nm = static_cast<double>(loaded.machine.rated_torque_nm);
  std::vector<hal::Sample> samples(1024);
  std::vector<hal::host::Truth> truths(samples.size());
  while (const auto count = sound(reader.read(samples, truths), name)) {
    for (std::size_t k = 0; k < count; ++k) {
      recorded.samples.push_back(samples[k]);
      recorded.truth.time_s.push_back(static_cast<double>(samples[k].time_ns) * 1e-9);
      recorded.truth.torque_nm.push_back(static_cast<double>(truths[k].cutting_torque_nm));
    }
  }
  return recorded;
}

firmware::host::Scenario committed_scenario(const std::string& name) {
  return sound(firmware::host::read_scenario(in_tests("scenarios/" + name + ".toml")), name);
}

Machine with_estimator(Machine machine, firmware::EstimatorName estimator) {
  machine.estimator = estimator;
  return machine;
}

std::vector<LoopOutput> run_over(ControlLoop& loop, std::span<const hal::Sample> samples) {
  std::vector<LoopOutput> outputs;
  for (const hal::Sample& sample : samples) {
    if (const auto output = loop.step(sample)) outputs.push_back(*output);
  }
  return outputs;
}

std::vector<ClosedLoopRow> run_closed_loop(const firmware::host::Scenario& scenario,
                                           const Machine& firmware_machine, double duration_s) {
  auto machine = sound(hal::host::SimulatedMachine::make(scenario.simulation), scenario.title);
  auto loop = sound(firmware::make_loop(firmware_machine), scenario.title);
  hal::host::SimulationPort port(machine, static_cast<double>(firmware_machine.control_period_s),
                                 duration_s);
  std::vector<ClosedLoopRow> rows;
  hal::Sample block{};  // one at a time: the truth is that of the last sample read
  const auto ran = firmware::run(port, loop, std::span(&block, 1), [&](const LoopOutput& output) {
    rows.push_back({.output = output, .truth = machine.truth()});
  });
  if (!ran) std::abort();
  return rows;
}

std::array<std::byte, kOutputBytes> bytes_of(const LoopOutput& output) {
  std::array<std::byte, kOutputBytes> bytes{};
  std::size_t at = 0;
  const auto put = [&](auto value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
    at += sizeof value;
  };
  put(output.time_ns);
  for (const auto& column : firmware::host::kTraceColumns) {
    if (column.number != nullptr) put(output.*column.number);
  }
  put(output.present);
  put(output.faults.bits);
  put(output.source);
  put(output.state);
  put(static_cast<std::uint8_t>(output.control_tick ? 1 : 0));
  if (at != kOutputBytes) std::abort();
  return bytes;
}

std::uint64_t hash_of(std::span<const LoopOutput> outputs) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const LoopOutput& output : outputs) {
    for (const std::byte byte : bytes_of(output)) {
      hash = (hash ^ std::to_integer<std::uint64_t>(byte)) * 0x100000001b3U;
    }
  }
  return hash;
}

std::ptrdiff_t first_difference(std::span<const LoopOutput> a, std::span<const LoopOutput> b) {
  const std::size_t both = std::min(a.size(), b.size());
  for (std::size_t k = 0; k < both; ++k) {
    if (bytes_of(a[k]) != bytes_of(b[k])) return static_cast<std::ptrdiff_t>(k);
  }
  return a.size() == b.size() ? -1 : static_cast<std::ptrdiff_t>(both);
}

std::string broken_rule(const LoopOutput& output, const Machine& machine) {
  for (const auto& column : firmware::host::kTraceColumns) {
    if (column.number == nullptr) continue;
    const float value = output.*column.number;
    if (!std::isfinite(value)) return std::string(column.name) + " is not finite";
    const bool there = (output.present & column.present) != 0;
    if (!there && std::bit_cast<std::uint32_t>(value) != 0) {
      return std::string(column.name) + " has a value and no bit";
    }
  }
  const auto has = [&](LoopOutput::Value value) { return (output.present & value) != 0; };
  if (output.cutting_torque_sigma_nm < 0.0F || output.cutting_force_sigma_n < 0.0F) {
    return "a sigma is negative";
  }
  if (has(LoopOutput::kOverride) && !(output.override_pct >= machine.override_floor_pct &&
                                      output.override_pct <= machine.override_ceiling_pct)) {
    return "the override is outside its limits";
  }
  const bool estimate = has(LoopOutput::kCuttingTorque) || has(LoopOutput::kCuttingForce);
  if (estimate != (output.source != firmware::Source::kNone)) return "source and estimate disagree";
  if (output.state == firmware::LoopState::kRefused && estimate) return "refused, yet an estimate";
  return {};
}

}  // namespace cutforce::host_tests
