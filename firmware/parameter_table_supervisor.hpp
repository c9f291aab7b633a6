// The part of the table of parameters that speaks of the supervisor: who may move the feed, how
// long what may be missing, and what goes out after a fault.
#pragma once

#include "firmware/parameter_describe.hpp"

namespace cutforce::firmware::detail {

[[nodiscard]] consteval auto supervisor_parameters() {
  using M = Machine;
  using enum Write;
  return std::to_array<Parameter>({
      // [supervisor]
      choice<&M::supervisor_mode>(
          0x0801, "supervisor_mode", SupervisorMode::kAdvise, SupervisorMode::kAdvise,
          kConstruction,
          "Whether the CNC may give control; advise estimates and never moves the feed."),
      flag<&M::link_required>(
          0x0802, "link_required", true, true, kConstruction,
          "Whether a CNC sends its state on CAN; without it, arming comes from the lines."),
      number<&M::fallback_pct>(0x0803, "fallback_pct", "%", {0, 254}, 70, 70, kIdle,
                               "Where the override falls to after a fault, never from below."),
      number<&M::hold_pct>(0x0804, "hold_pct", "%", {0, 254}, 0, 0, kIdle,
                           "Feed-hold request: what goes out beyond force_limit_n."),
      number<&M::fall_pct_s>(0x0805, "fall_pct_s", "%/s", {0.1F, 100000}, 5, 5, kIdle,
                             "Fall of the override after a fault, on the way to fallback_pct."),
      number<&M::link_timeout_s>(
          0x0806, "link_timeout_s", "s", {0.02F, 10}, 0.25F, 0.25F, kConstruction,
          "How long the CNC may send nothing new before the link is lost; five of its periods at "
          "least."),
      number<&M::samples_timeout_s>(
          0x0807, "samples_timeout_s", "s", {0.002F, 10}, 0.2F, 0.2F, kConstruction,
          "How long samples may be missing in control; from half of it on nothing rises."),
      number<&M::estimate_timeout_s>(
          0x0808, "estimate_timeout_s", "s", {0.01F, 60}, 2, 2, kConstruction,
          "How long a force may be missing in control; the override falls before that."),
      number<&M::hold_release_s>(
          0x0809, "hold_release_s", "s", {0.002F, 10}, 0.5F, 0.5F, kConstruction,
          "How long the cause of a hold must be gone before control goes on."),
      number<&M::overrun_window_s>(0x080a, "overrun_window_s", "s", {0.1F, 60}, 1, 1, kConstruction,
                                   "Time over which missed ticks are counted."),
      number<&M::overrun_ratio>(
          0x080b, "overrun_ratio", "", {0.0001F, 0.5F}, 0.01F, 0.01F, kConstruction,
          "Missed ticks, as a part of those in overrun_window_s, above which nothing rises."),
  });
}

}  // namespace cutforce::firmware::detail
