// A supervisor with everything around it in order, and a person who presses buttons.
#pragma once

#include <gtest/gtest.h>

#include "control/supervisor.hpp"
#include "support/sound_input.hpp"

namespace cutforce::host_tests {

// Times of a few steps, so that a test sees each of them end.
inline constexpr control::Supervisor::Config kSupervised{
    .period_s = 0.001F,
    .mode = control::SupervisorMode::kControl,
    .link_required = true,
    .neutral_pct = 100.0F,
    .fallback_pct = 70.0F,
    .hold_pct = 0.0F,
    .fall_pct_s = 5.0F,
    .link_timeout_s = 0.25F,
    .samples_timeout_s = 0.2F,
    .estimate_timeout_s = 2.0F,
    .hold_release_s = 0.5F,
    .overrun_window_s = 1.0F,
    .overrun_ratio = 0.01F,
};
static_assert(kSupervised.check());

// How much the board may do: what leads up needs a person.
[[nodiscard]] constexpr int authority(control::SupervisorState state) {
  using S = control::SupervisorState;
  switch (state) {
    case S::kControl:
      return 3;
    case S::kHold:
      return 3;
    case S::kMonitor:
      return 2;
    case S::kReady:
      return 1;
    case S::kBoot:
    case S::kSelfTest:
    case S::kCheck:
    case S::kLinkLost:
    case S::kProtect:
    case S::kSafe:
    case S::kDead:
      return 0;
  }
  return 0;
}

struct SupervisorBench {
  control::Supervisor supervisor;
  control::Supervisor::Input input = sound_input();
  control::Supervisor::Output output{};

  explicit SupervisorBench(const control::Supervisor::Config& config = kSupervised)
      : supervisor(control::Supervisor::make(config).value()) {}

  control::SupervisorState step(int steps = 1) {
    for (int i = 0; i < steps; ++i) output = supervisor.step(input);
    return output.state;
  }
  // By the way a person takes. The controller is at neutral until it has control.
  control::SupervisorState lead_to(control::SupervisorState goal) {
    using enum control::SupervisorState;
    input.override_pct = 100;
    if (goal == kBoot) return kBoot;
    step();
    if (goal == kSelfTest) return output.state;
    step();
    if (goal == kCheck) return output.state;
    step(2);
    if (goal == kReady) return output.state;
    input.arm = true;
    step(2);
    if (goal == kMonitor) return output.state;
    input.control = true;
    step();
    input.override_pct = 80;
    step();
    if (goal == kControl) return output.state;
    if (goal == kHold) input.inhibit = true;
    if (goal == kLinkLost) input.bus_down = true;
    if (goal == kProtect) input.force_n = 3000.0F;
    if (goal == kSafe) input.output_failed = true;
    if (goal == kDead) input.stop = true;
    step(2);
    input.inhibit = input.bus_down = input.output_failed = input.stop = false;
    input.force_n = 400.0F;
    return output.state;
  }
};

// One that has been led to a state as a person would.
[[nodiscard]] inline SupervisorBench bench_in(
    control::SupervisorState state, const control::Supervisor::Config& config = kSupervised) {
  SupervisorBench bench(config);
  EXPECT_EQ(bench.lead_to(state), state);
  return bench;
}

}  // namespace cutforce::host_tests
