// The part of configuration.hpp that speaks of control.
#pragma once

#include "control/control_path.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware {

// `machine` must pass check(Machine).
[[nodiscard]] control::ControlPath::Config control_path_config(const Machine& machine,
                                                               float period_s) noexcept;

}  // namespace cutforce::firmware
