// What a supervisor is told where all is well. Without a test library: the bare-metal meter uses
// it.
#pragma once

#include "control/supervisor.hpp"

namespace cutforce::host_tests {

// Spindle at speed, in the cut, the controller at 80 %; nobody has pressed anything.
[[nodiscard]] constexpr control::Supervisor::Input sound_input() {
  return {.self_test_done = true,
          .self_test_passed = true,
          .checks_passed = true,
          .output_failed = false,
          .foreign = false,
          .stop = false,
          .bus_down = false,
          .inhibit = false,
          .threading = false,
          .signals_refused = false,
          .reversed = false,
          .arm = false,
          .control = false,
          .reset = false,
          .spindle_at_speed = true,
          .feeding = true,
          .machine_state_new = true,
          .sample_new = true,
          .force_new = true,
          .missed_ticks = 0,
          .force_n = 400.0F,
          .force_limit_n = 1000.0F,
          .override_pct = 80};
}

}  // namespace cutforce::host_tests
