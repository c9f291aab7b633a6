#include "firmware/host/reproduce/closed_loop.hpp"

#include <limits>
#include <span>

#include "firmware/host/commands/progress.hpp"
#include "firmware/host/run/loop_recorder.hpp"
#include "hal/host/simulation/force_machine_port.hpp"
#include "hal/host/simulation/simulation_port.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::ForceMachine;
using hal::host::ForceMachinePort;
using hal::host::SimulatedMachine;
using hal::host::SimulationPort;

void add_step(ClosedLoop& run, double time_s, double force_n, double depth_m) {
  run.time_s.push_back(time_s);
  run.force_n.push_back(force_n);
  run.depth_m.push_back(depth_m);
}

void add_tick(ClosedLoop& run, const LoopOutput& output, const hal::Command& command) {
  const bool seen = (output.present & LoopOutput::kCuttingForce) != 0;
  run.tick_s.push_back(static_cast<double>(output.time_ns) * 1e-9);
  run.seen_n.push_back(seen ? static_cast<double>(output.cutting_force_n)
                            : std::numeric_limits<double>::quiet_NaN());
  run.override_pct.push_back(static_cast<double>(command.override_pct));
}

// A port that a person may stop.
template <class P>
class Stoppable {
 public:
  Stoppable(P& port, double duration_s) : port_(port), progress_("reproduce", "s", duration_s) {}

  std::expected<std::size_t, hal::PortError> read(std::span<hal::Sample> block) {
    auto count = port_.read(block);
    if (count && *count > 0) progress_.update(static_cast<double>(block.front().time_ns) * 1e-9);
    return count;
  }
  std::expected<void, hal::PortError> write(const hal::Command& command) {
    return port_.write(command);
  }

 private:
  P& port_;
  Progress progress_;
};

template <class P, class Sink>
void run_on(P& port, double duration_s, ControlLoop& loop, Sink&& sink) {
  Stoppable stoppable(port, duration_s);
  hal::Sample block{};
  // A simulation's port does not fail.
  (void)run(stoppable, loop, std::span(&block, 1), sink);
}

std::expected<void, InputError> run_force(const Scenario& scenario, ControlLoop& loop,
                                          ClosedLoop& run) {
  auto machine = ForceMachine::make(scenario.force);
  if (!machine) return std::unexpected{machine.error()};
  ForceMachinePort port(*machine, scenario.duration_s, [&run](const ForceMachine& now) {
    const auto truth = now.truth();
    add_step(run, truth.time_s, truth.force_n, truth.depth_m);
    if (!now.at_end()) run.finished_s = truth.time_s;
  });
  run_on(port, scenario.duration_s, loop,
         [&](const LoopOutput& output) { add_tick(run, output, loop.command()); });
  return {};
}

std::expected<void, InputError> run_motor(const Scenario& scenario, ControlLoop& loop,
                                          ClosedLoop& run) {
  auto machine = SimulatedMachine::make(scenario.simulation);
  if (!machine) return std::unexpected{machine.error()};
  SimulationPort port(*machine, run.period_s, scenario.duration_s);
  run_on(port, scenario.duration_s, loop, [&](const LoopOutput& output) {
    const auto truth = port.truth();
    const double time_s = static_cast<double>(output.time_ns) * 1e-9;
    add_step(run, time_s, truth.cutting_force_n, truth.depth_m);
    if (truth.position_m < scenario.simulation.feed.length_m) run.finished_s = time_s;
    if (output.control_tick) add_tick(run, output, loop.command());
  });
  return {};
}

}  // namespace

std::expected<ClosedLoop, InputError> run_closed_loop(const Scenario& scenario) {
  auto loop = loop_for(scenario.machine, scenario.title);
  if (!loop) return std::unexpected{loop.error()};
  ClosedLoop run{};
  run.reference_n = static_cast<double>(scenario.machine.force_reference_n);
  run.ceiling_pct = static_cast<double>(scenario.machine.override_ceiling_pct);
  run.period_s = static_cast<double>(scenario.machine.control_period_s);
  const auto ran = scenario.model == Model::kForce ? run_force(scenario, *loop, run)
                                                   : run_motor(scenario, *loop, run);
  if (!ran) return std::unexpected{ran.error()};
  return run;
}

}  // namespace cutforce::firmware::host
