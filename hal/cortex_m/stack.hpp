// The stack: how deep it has been, and the guard below it.
//
// It lies at the begin of RAM (sections.ld). The guard is a region of the MPU over the 64 KiB
// below, which costs no memory: what overflows the stack, by a word or by a large frame, is stopped
// there, and the fault handler names it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace cutforce::hal::cortex_m {

// Fills what lies below the stack pointer, for stack_high_water().
void paint_stack() noexcept;

// Bytes of the stack that have been used since it was painted, and all of it. What was used and
// still holds the paint is not seen.
[[nodiscard]] std::size_t stack_high_water() noexcept;
[[nodiscard]] std::size_t stack_size() noexcept;

// Turns the MPU on, with the one region; everything else keeps the default memory map.
void guard_stack() noexcept;

// Whether an address lies in the guard.
[[nodiscard]] bool is_below_stack(std::uint32_t address) noexcept;

}  // namespace cutforce::hal::cortex_m
