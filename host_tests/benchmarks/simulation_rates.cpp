// How much faster than the real machine the simulated one runs, on one core.
// times_real_time is what counts: averaged inverter at 5 kHz should reach 500.
#include <benchmark/benchmark.h>

#include "hal/host/simulation/simulated_machine.hpp"

namespace cutforce {
namespace {

using hal::host::SimulatedMachine;
using hal::host::SimulatedMachineConfig;

void run(benchmark::State& state, const SimulatedMachineConfig& config) {
  auto machine = SimulatedMachine::make(config);
  if (!machine) {
    state.SkipWithError(machine.error().text().c_str());
    return;
  }
  for (auto _ : state) benchmark::DoNotOptimize(machine->advance());
  const double samples = static_cast<double>(state.iterations());
  state.counters["times_real_time"] =
      benchmark::Counter(samples / config.sample_rate_hz, benchmark::Counter::kIsRate);
}

SimulatedMachineConfig noisy_lathe() {
  SimulatedMachineConfig config = hal::host::default_lathe();
  for (auto& channel : config.sensors.voltage) {
    channel = {.noise = 1.0, .range = 400.0, .bits = 12.0};
  }
  for (auto& channel : config.sensors.current) {
    channel = {.noise = 0.1, .range = 100.0, .bits = 12.0};
  }
  config.sensors.speed.noise_rad_s = 0.05;
  return config;
}

void averaged_lathe(benchmark::State& state) { run(state, hal::host::default_lathe()); }
void averaged_lathe_with_noise(benchmark::State& state) { run(state, noisy_lathe()); }
void averaged_motor_a(benchmark::State& state) { run(state, hal::host::motor_a()); }
void switched_motor_a(benchmark::State& state) {
  SimulatedMachineConfig config = hal::host::motor_a();
  config.inverter = {.dc_link_v = 540.0, .switched = true, .anti_alias_hz = 1600.0};
  config.sensors.voltage_signal = hal::host::VoltageSignal::kInstantaneous;
  run(state, config);
}

BENCHMARK(averaged_lathe);
BENCHMARK(averaged_lathe_with_noise);
BENCHMARK(averaged_motor_a);
BENCHMARK(switched_motor_a);

}  // namespace
}  // namespace cutforce
