#include <CLI/CLI.hpp>
#include <array>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "firmware/host/commands/command.hpp"
#include "firmware/host/commands/machine_options.hpp"
#include "firmware/host/number_text.hpp"
#include "firmware/host/run/loop_recorder.hpp"
#include "firmware/host/trace_format.hpp"
#include "hal/host/lockstep_port.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::LockstepAnswer;
using hal::host::LockstepPort;
using hal::host::LockstepVoltages;

struct Options {
  MachineOptions machine;
  double sample_rate_hz = 0.0;
  std::string voltages;
};

constexpr std::size_t kBlockRows = 1024;

std::string fault_text(estimator::FaultSet faults) {
  std::string text;
  for (std::size_t k = 0; k < estimator::kFaultCount; ++k) {
    if (!faults.contains(static_cast<estimator::Fault>(k))) continue;
    if (!text.empty()) text += kFaultSeparator;
    text += estimator::kFaultNames[k];
  }
  return text;
}

void put_text(LockstepAnswer& answer, std::string_view key, std::string_view value) {
  if (value.empty()) {
    answer.absent(key);
  } else {
    answer.text(key, value);
  }
}

// The trace's columns, of the last control tick; before the first, nothing exists but the state.
void fill(LockstepAnswer& answer, const std::optional<LoopOutput>& output) {
  for (const TraceColumn& column : kTraceColumns) {
    if (!output) {
      put_text(answer, column.name, column.role == TraceRole::kState ? kStateNames[0] : "");
      continue;
    }
    switch (column.role) {
      case TraceRole::kTime:
        answer.number(column.name, static_cast<double>(output->time_ns) * 1e-9);
        break;
      case TraceRole::kNumber:
        if ((output->present & column.present) != 0) {
          answer.number(column.name, (*output).*column.number);
        } else {
          answer.absent(column.name);
        }
        break;
      case TraceRole::kSource:
        put_text(answer, column.name, kSourceNames[static_cast<std::size_t>(output->source)]);
        break;
      case TraceRole::kState:
        put_text(answer, column.name, kStateNames[static_cast<std::size_t>(output->state)]);
        break;
      case TraceRole::kFault:
        put_text(answer, column.name, fault_text(output->faults));
        break;
    }
  }
}

MachineRequest request_of(const Options& options) {
  MachineRequest request = options.machine.request();
  if (options.sample_rate_hz > 0.0) {
    request.options.push_back({"--sample-rate", "sample_rate_hz",
                               number_text(static_cast<float>(options.sample_rate_hz))});
  }
  if (!options.voltages.empty()) {
    request.options.push_back({"--voltages", "voltage_kind", options.voltages});
  }
  return request;
}

Exit perform(const Options& options) {
  if (options.machine.file.empty()) {
    return refuse(InputError{"--machine", "no machine file is named",
                             "name one; cutforce check --template writes one to start from"});
  }
  const auto loaded = requested_machine(request_of(options));
  if (!loaded) return refuse(loaded.error());
  show_warnings(loaded->warnings);
  auto loop = loop_for(loaded->machine, options.machine.file);
  if (!loop) return refuse(loop.error());

  std::ios::sync_with_stdio(false);
  std::optional<LoopOutput> last;
  const bool lines = loaded->machine.voltage_kind == VoltageKind::kLineToLine;
  LockstepPort port(
      std::cin, std::cout, [&last](LockstepAnswer& answer) { fill(answer, last); },
      lines ? LockstepVoltages::kLineToLine : LockstepVoltages::kLineToNeutral);
  std::vector<hal::Sample> block(kBlockRows);
  estimator::FaultSet faults{};
  const auto ran = run(port, *loop, block, [&](const LoopOutput& output) {
    faults = faults | output.faults;
    if (!output.control_tick) return;
    last = output;
    last->faults = faults;  // of the whole control period
    faults = {};
  });
  if (ran) return Exit::kDone;
  if (port.error()) return refuse(*port.error());
  show_error({"standard output", "an answer could not be written", "keep both ends of it open"});
  return Exit::kFailed;
}

}  // namespace

void add_lockstep(CLI::App& program, Action& action) {
  auto* command = program.add_subcommand(
      "lockstep", "The loop driven by an outside plant: JSON lines on standard input and output");
  auto options = std::make_shared<Options>();
  options->machine.add_to(*command);
  command
      ->add_option("--sample-rate", options->sample_rate_hz,
                   "Samples a second; it wins over the machine file. With the estimator "
                   "dynamometer it may be left out: a sample each control period")
      ->type_name("HZ")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--voltages", options->voltages,
                   names_text<VoltageKind>() + "; it wins over the machine file")
      ->type_name("KIND");
  command->footer(
      R"(One line in, one line out, flushed, strictly alternating. In: a sample, or a block of them as arrays,
with the recording's column names as keys. Out: the trace's names, of the last control tick.

Examples:
  cutforce lockstep --machine lathe.toml --sample-rate 5000
  {"t_s": 0.0002, "v_un_v": 101.2, "v_vn_v": -80.5, "v_wn_v": -20.7, "i_u_a": 9.1, "i_v_a": -3.3,
   "i_w_a": -5.8, "speed_rad_s": 104.7}                                          (on one line)

With --estimator dynamometer a line needs measured_force_n alone, and each line is a control tick:
  cutforce lockstep --machine lathe.toml --estimator dynamometer --controller pi
  {"t_s": 0.05, "measured_force_n": 412.0}

A line that cannot be understood is answered by {"error": ...} and ends the dialogue (exit status 2).)");
  command->callback([options, &action] { action = [options] { return perform(*options); }; });
}

}  // namespace cutforce::firmware::host
