#include "firmware/host/run/digest.hpp"

#include <optional>
#include <span>
#include <utility>

#include "firmware/host/run/loop_recorder.hpp"
#include "firmware/host/run/recorded_machine.hpp"
#include "firmware/host/scenario/scenario.hpp"
#include "hal/host/output_file.hpp"
#include "hal/host/simulation/force_machine_port.hpp"
#include "hal/host/simulation/simulation_port.hpp"
#include "hal/host/truth_reader.hpp"
#include "hal/sample_stream.hpp"

namespace cutforce::firmware::host {
namespace {

using Errors = std::vector<InputError>;
using hal::SampleStreamHeader;

std::unexpected<Errors> failed(const InputError& error) { return std::unexpected{Errors{error}}; }

template <class T>
std::span<const char> bytes_of(std::span<T> values) {
  const auto bytes = std::as_bytes(values);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// What went through a port, in its order.
template <class P>
class KeptSamples {
 public:
  explicit KeptSamples(P& port) : port_(port) {}

  std::expected<std::size_t, hal::PortError> read(std::span<hal::Sample> block) {
    const auto count = port_.read(block);
    if (count) {
      const auto read = block.first(*count);
      samples_.insert(samples_.end(), read.begin(), read.end());
    }
    return count;
  }
  std::expected<void, hal::PortError> write(const hal::Command& command) {
    return port_.write(command);
  }
  [[nodiscard]] std::span<const hal::Sample> samples() const noexcept { return samples_; }

 private:
  P& port_;
  std::vector<hal::Sample> samples_;
};

std::expected<void, InputError> write_stream(const std::filesystem::path& path,
                                             const Machine& machine,
                                             std::span<const hal::Sample> samples) {
  auto file = hal::host::OutputFile::create(path);
  if (!file) return std::unexpected{file.error()};
  const auto header = SampleStreamHeader::of(sizeof(Machine), samples.size());
  for (const auto part :
       {bytes_of(std::span(&header, 1)), bytes_of(std::span(&machine, 1)), bytes_of(samples)}) {
    if (auto written = file->write(part); !written) return written;
  }
  return file->finish();
}

// `error_of` tells what stopped a port, if anything did.
template <class P, class ErrorOf>
std::expected<DigestResult, Errors> digest_on(P& port, const Machine& machine,
                                              const DigestRequest& request,
                                              const ErrorOf& error_of) {
  auto loop = loop_for(machine, request.file.string());
  if (!loop) return failed(loop.error());
  KeptSamples kept(port);
  LoopDigest digest;
  hal::Sample block{};
  const auto ran = run(kept, *loop, std::span(&block, 1), [&](const LoopOutput& output) {
    digest.take(output);
    if (output.control_tick) digest.take(loop->command());
  });
  if (!ran) return failed(error_of());
  if (!request.stream.empty()) {
    if (const auto written = write_stream(request.stream, machine, kept.samples()); !written) {
      return failed(written.error());
    }
  }
  return DigestResult{digest, kept.samples().size()};
}

std::expected<DigestResult, Errors> digest_of_scenario(const DigestRequest& request) {
  const auto scenario = read_scenario(request.file, request.options);
  if (!scenario) return std::unexpected{scenario.error()};
  const auto stopped = [&] {
    return InputError{request.file.string(), "the simulation stopped", "report this as a fault"};
  };
  if (scenario->model == Model::kForce) {
    auto machine = hal::host::ForceMachine::make(scenario->force);
    if (!machine) return failed(machine.error());
    hal::host::ForceMachinePort port(*machine, scenario->duration_s);
    return digest_on(port, scenario->machine, request, stopped);
  }
  auto machine = hal::host::SimulatedMachine::make(scenario->simulation);
  if (!machine) return failed(machine.error());
  hal::host::SimulationPort port(*machine, static_cast<double>(scenario->machine.control_period_s),
                                 scenario->duration_s);
  return digest_on(port, scenario->machine, request, stopped);
}

// The reader of a recording with its truth, as a port: only it knows which signals there are.
class RecordedPort {
 public:
  explicit RecordedPort(hal::host::TruthReader reader) : reader_(std::move(reader)) {}

  std::expected<std::size_t, hal::PortError> read(std::span<hal::Sample> block) {
    std::vector<hal::host::Truth> unused(block.size());
    auto count = reader_.read(block, unused);
    if (count) return *count;
    error_ = std::move(count.error());
    return std::unexpected{hal::PortError::kMalformed};
  }
  std::expected<void, hal::PortError> write(const hal::Command&) { return {}; }
  [[nodiscard]] InputError error() const { return error_.value(); }

 private:
  hal::host::TruthReader reader_;
  std::optional<InputError> error_;
};

std::expected<DigestResult, Errors> digest_of_recording(const DigestRequest& request) {
  auto reader = hal::host::TruthReader::open(request.file);
  if (!reader) return failed(reader.error());
  const auto period = reader->sample_period();
  if (!period) return failed(period.error());
  const auto loaded =
      recorded_machine(reader->info(), *period, {.machine_file = {}, .options = request.options});
  if (!loaded) return std::unexpected{loaded.error()};
  RecordedPort port(std::move(*reader));
  return digest_on(port, loaded->machine, request, [&] { return port.error(); });
}

}  // namespace

std::expected<DigestResult, Errors> digest_of(const DigestRequest& request) {
  return request.file.extension() == ".toml" ? digest_of_scenario(request)
                                             : digest_of_recording(request);
}

}  // namespace cutforce::firmware::host
