// The part of configuration.hpp that speaks of the supervisor.
#pragma once

#include "control/supervisor.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware {

// Stepped once an estimate period. `machine` must pass check(Machine).
[[nodiscard]] constexpr control::Supervisor::Config make_supervisor_config(
    const Machine& m) noexcept {
  return {.period_s = estimate_period_s(m),
          .mode = m.supervisor_mode == SupervisorMode::kControl ? control::SupervisorMode::kControl
                                                                : control::SupervisorMode::kAdvise,
          .link_required = m.link_required,
          .neutral_pct = m.override_initial_pct,
          .fallback_pct = m.fallback_pct,
          .hold_pct = m.hold_pct,
          .fall_pct_s = m.fall_pct_s,
          .link_timeout_s = m.link_timeout_s,
          .samples_timeout_s = m.samples_timeout_s,
          .estimate_timeout_s = m.estimate_timeout_s,
          .hold_release_s = m.hold_release_s,
          .overrun_window_s = m.overrun_window_s,
          .overrun_ratio = m.overrun_ratio};
}

}  // namespace cutforce::firmware
