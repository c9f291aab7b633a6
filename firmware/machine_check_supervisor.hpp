// The part of machine_check.hpp that speaks of the supervisor. What it cannot work with is refused
// where it may give control; a simulation in steps of half a second needs none of it.
#pragma once

#include "firmware/machine_rule.hpp"

namespace cutforce::firmware::detail {

[[nodiscard]] constexpr bool advises(const Machine& m) noexcept {
  return m.supervisor_mode == SupervisorMode::kAdvise;
}

inline constexpr auto kSupervisorRules = std::to_array<MachineRule>({
    {{"fallback_pct", "override_initial_pct"},
     [](const Machine& m) noexcept {
       return advises(m) || m.fallback_pct <= m.override_initial_pct;
     },
     "a fault would not lower the override below that of a machine without control",
     "lower fallback_pct to override_initial_pct or less"},
    {{"hold_pct", "fallback_pct"},
     [](const Machine& m) noexcept { return advises(m) || m.hold_pct <= m.fallback_pct; },
     "the feed-hold request is above what follows any other fault",
     "lower hold_pct; 0 holds the feed"},
    {{"samples_timeout_s", "estimate_period_s"},
     [](const Machine& m) noexcept {
       return advises(m) || m.samples_timeout_s >= 2.0F * estimate_period_s(m);
     },
     "the samples would be missing between two estimates",
     "give two estimate periods or more"},
    {{"estimate_timeout_s", "control_period_s"},
     [](const Machine& m) noexcept {
       return advises(m) || m.estimate_timeout_s >= 2.0F * m.control_period_s;
     },
     "the force would be missing between two control ticks",
     "give two control periods or more"},
    {{"hold_release_s", "control_period_s"},
     [](const Machine& m) noexcept {
       return advises(m) || m.hold_release_s >= 2.0F * m.control_period_s;
     },
     "the controller would not know of a hold before it is over",
     "give two control periods or more; 0.5 is usual"},
    {{"overrun_window_s", "estimate_period_s"},
     [](const Machine& m) noexcept {
       return advises(m) || m.overrun_window_s >= 8.0F * estimate_period_s(m);
     },
     "too few ticks fit into the window to count the missed ones",
     "give eight estimate periods or more"},
});

}  // namespace cutforce::firmware::detail
