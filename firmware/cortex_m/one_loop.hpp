// The one control loop of an image, made where it stays: it is too large for a stack.
#pragma once

#include "firmware/control_loop.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware::cortex_m {

// Null where the machine's parameters make no loop. The loop of an earlier call is gone.
[[nodiscard]] ControlLoop* make_the_loop(const Machine& machine) noexcept;

}  // namespace cutforce::firmware::cortex_m
