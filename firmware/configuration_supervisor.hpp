// The part of configuration.hpp that speaks of the supervisor.
#pragma once

#include "control/supervisor.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware {

// Stepped once an estimate period. `machine` must pass check(Machine).
[[nodiscard]] control::Supervisor::Config make_supervisor_config(const Machine& machine) noexcept;

}  // namespace cutforce::firmware
