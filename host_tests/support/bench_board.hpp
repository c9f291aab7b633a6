// The board beside the bench, in one process: a bus that delivers at once or late, and a board that
// is a call. What the system tests do with an emulated board, without its time.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "firmware/configuration_board.hpp"
#include "firmware/host/bench/bench.hpp"
#include "support/loop_support.hpp"

namespace cutforce::host_tests {

[[nodiscard]] inline firmware::host::Bench::Config bench_config() {
  return {.node = 1,
          .cnc = {.scan_ns = 10'000'000,
                  .timeout_ns = 250'000'000,
                  .on_silence = firmware::host::OnSilence::kHold,
                  .arm = true,
                  .control = true,
                  .rearm = false,
                  .arm_ns = 1'500'000'000,
                  .control_ns = 2'000'000'000},
          .job = {},
          .tool = 1,
          .wait_for_board = false,
          .threading = false,
          .code = control::OverrideCode::kBinary,
          .by_lines = false,
          .has_alive = true,
          .inhibit_ns = 0,
          .inhibit_end_ns = 0};
}

[[nodiscard]] inline firmware::host::Bench bench_with(
    const firmware::host::Scenario& scenario, const firmware::host::Bench::Config& config,
    std::uint32_t speed_every = firmware::host::kSpeedEvery) {
  auto lathe = firmware::host::BenchLathe::make(scenario, config.node, speed_every);
  return firmware::host::Bench::make(config, std::move(*lathe)).value();
}

// The machine as the file beside the scenario would have it, in the mode that takes control.
[[nodiscard]] inline firmware::Machine machine_of(const firmware::host::Scenario& scenario) {
  firmware::Machine machine = scenario.machine;
  machine.supervisor_mode = firmware::SupervisorMode::kControl;
  return machine;
}

[[nodiscard]] inline firmware::Board board_of(const firmware::host::Scenario& scenario,
                                              std::uint8_t node = 1) {
  const auto scale = firmware::host::full_scale_of(scenario);
  return firmware::make_board(machine_of(scenario), {.node = node,
                                                     .samples_by_can = true,
                                                     .voltage_full_scale_v = scale.voltage_v,
                                                     .current_full_scale_a = scale.current_a})
      .value();
}

// Runs board and bench, sample by sample. The board is awake `delay()` after each sample has been
// sent, in whole nanoseconds below the CNC's scan; what it sends is there when it comes. `Device`
// is the board itself, or what stands for one elsewhere.
template <class Device>
struct BenchBeside {
  firmware::host::Bench& bench;
  Device& board;
  std::function<std::int64_t()> delay_ns = [] { return 300'000; };
  // Between board and bench; may change a frame, or drop it by returning false.
  std::function<bool(hal::can::Frame&, std::int64_t)> to_bench = [](hal::can::Frame&,
                                                                    std::int64_t) { return true; };
  // Sees every row of the board's trace.
  std::function<void(const firmware::LoopOutput&)> sink = [](const firmware::LoopOutput&) {};
  std::int64_t clock_ns = 1'000'000'000;  // the board's, of any origin
  std::uint32_t sent = 0;

  struct Flying {
    std::int64_t due_ns;
    hal::can::Frame frame;
  };
  std::deque<Flying> flying{};

  void step() {
    while (!flying.empty() && flying.front().due_ns <= clock_ns) {
      bench.receive(flying.front().frame);
      flying.pop_front();
    }
    std::array<hal::can::Frame, firmware::host::Bench::kMostFrames> frames;
    const std::size_t count = bench.step(frames);
    for (std::size_t k = 0; k < count; ++k) {
      if (const auto row = board.receive(frames[k], clock_ns)) sink(*row);
    }
    const auto out = board.tick(clock_ns, {.self_test_done = true,
                                           .self_test_passed = true,
                                           .ports_open = true,
                                           .output_failed = false,
                                           .stop = false,
                                           .has_bus = true,
                                           .bus = {.state = hal::BusState::kActive,
                                                   .acknowledged = true,
                                                   .restarts = 0,
                                                   .unsent = 0,
                                                   .overrun = 0,
                                                   .error_frames = 0},
                                           .lines = {.acknowledged = true, .inhibit = false},
                                           .missed_ticks = 0,
                                           .lost_samples = 0,
                                           .worst_loop_us = 100});
    if (out.frame) {
      hal::can::Frame frame = *out.frame;
      board.sent();
      ++sent;
      const std::int64_t due_ns = clock_ns + delay_ns();
      const std::int64_t after_ns = flying.empty() ? due_ns : flying.back().due_ns;
      if (to_bench(frame, clock_ns)) flying.push_back({std::max(due_ns, after_ns), frame});
    }
    clock_ns += bench.period_ns();
  }
};
using BenchTogether = BenchBeside<firmware::Board>;

}  // namespace cutforce::host_tests
