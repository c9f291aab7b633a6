// The one control loop of an image, made where it stays: it is too large for a stack.
#pragma once

#include <array>
#include <cstddef>
#include <expected>
#include <new>

#include "firmware/configuration.hpp"
#include "firmware/control_loop.hpp"

namespace cutforce::firmware::cortex_m {

using MadeLoop = std::expected<ControlLoop, ControlLoop::ConfigError>;

// Null where the machine's parameters make no loop. The loop of an earlier call is gone.
[[nodiscard]] ControlLoop* make_the_loop(const Machine& machine) noexcept;

}  // namespace cutforce::firmware::cortex_m
