// Every fault is named, on the UART and where there is one to the debugger, and then the image
// stops: the watchdog, if it runs, resets the board. Nothing tries to go on.
#pragma once

namespace cutforce::hal::cortex_m {

// Faults of their own kind instead of a hard fault for each; a division by zero is one.
void enable_faults() noexcept;

// abort(), a pure virtual call, image_main() that returned: there is nothing left to run.
[[noreturn]] void stop_abandoned() noexcept;

extern "C" {
// The vector table's. Each works on a stack of its own: the main one may be the reason.
void nmi_handler();
void hard_fault_handler();
void memory_fault_handler();
void bus_fault_handler();
void usage_fault_handler();
void secure_fault_handler();
void interrupt_fault_handler();  // an interrupt that nobody handles
}

}  // namespace cutforce::hal::cortex_m
