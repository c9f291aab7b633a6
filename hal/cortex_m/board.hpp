// Where the peripherals of the board are. The build defines one of CUTFORCE_BOARD_AN500, _AN386
// and _AN505: Arm MPS2 and MPS2+ FPGA prototyping boards, as QEMU's mps2-... machines model them.
// AN505 is used from its secure side, whose peripherals lie 0x10000000 above.
#pragma once

#include <cstdint>
#include <string_view>

namespace cutforce::hal::cortex_m {

struct Board {
  std::string_view name;
  std::uintptr_t timer;
  std::uintptr_t uart;
  std::uint32_t uart_interrupt;  // of a received character, its number at the core
  std::uintptr_t watchdog;
  std::uintptr_t pins;  // of the override byte
  std::uint32_t clock_hz;
};

inline constexpr Board kAn500{.name = "mps2-an500",
                              .timer = 0x40000000,
                              .uart = 0x40004000,
                              .uart_interrupt = 0,
                              .watchdog = 0x40008000,
                              .pins = 0x40010000,
                              .clock_hz = 25'000'000};
inline constexpr Board kAn386{.name = "mps2-an386",
                              .timer = 0x40000000,
                              .uart = 0x40004000,
                              .uart_interrupt = 0,
                              .watchdog = 0x40008000,
                              .pins = 0x40010000,
                              .clock_hz = 25'000'000};
inline constexpr Board kAn505{.name = "mps2-an505",
                              .timer = 0x50000000,
                              .uart = 0x50200000,
                              .uart_interrupt = 33,
                              .watchdog = 0x50081000,
                              .pins = 0x50100000,
                              .clock_hz = 20'000'000};

#if defined(CUTFORCE_BOARD_AN386)
inline constexpr Board kBoard = kAn386;
#elif defined(CUTFORCE_BOARD_AN505)
inline constexpr Board kBoard = kAn505;
#else
inline constexpr Board kBoard = kAn500;
#endif

}  // namespace cutforce::hal::cortex_m
