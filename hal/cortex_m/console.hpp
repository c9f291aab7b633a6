// Where an image tells a person something. Two are there, one is linked: console_uart.cpp for a
// board, console_semihosting.cpp for a debugger or QEMU.
#pragma once

#include <cstdint>
#include <string_view>

namespace cutforce::hal::cortex_m::console {

void write(std::string_view text) noexcept;
void write_number(std::uint32_t value) noexcept;
void write_hexadecimal(std::uint64_t value) noexcept;  // sixteen digits

// The image's last word: its status to the debugger; on a board it waits for the watchdog.
[[noreturn]] void stop(int status) noexcept;

}  // namespace cutforce::hal::cortex_m::console
