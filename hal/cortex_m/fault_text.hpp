// What a fault's status registers say, in words: CFSR, HFSR, MMFAR and BFAR of Arm v7-M and v8-M.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace cutforce::hal::cortex_m {

struct FaultBit {
  std::uint32_t mask;
  std::string_view words;
};

inline constexpr std::uint32_t kInstructionAccess = 1U << 0;
inline constexpr std::uint32_t kDataAccess = 1U << 1;
inline constexpr std::uint32_t kMemoryStacking = 1U << 4;
inline constexpr std::uint32_t kMemoryStackingFloat = 1U << 5;
inline constexpr std::uint32_t kMemoryAddressValid = 1U << 7;
inline constexpr std::uint32_t kBusStacking = 1U << 12;
inline constexpr std::uint32_t kBusStackingFloat = 1U << 13;
inline constexpr std::uint32_t kBusAddressValid = 1U << 15;
inline constexpr std::uint32_t kStackLimit = 1U << 20;

// In the order of the register.
inline constexpr std::array<FaultBit, 18> kFaultBits{{
    {kInstructionAccess, "instruction fetched from where none may be"},
    {kDataAccess, "data access that the memory protection forbids"},
    {1U << 3, "memory protection, while a handler returned"},
    {kMemoryStacking, "memory protection, while a handler was entered"},
    {kMemoryStackingFloat, "memory protection, while floating-point state was saved"},
    {1U << 8, "bus error, while an instruction was fetched"},
    {1U << 9, "bus error, of a load or store"},
    {1U << 10, "bus error, of a store some instructions ago"},
    {1U << 11, "bus error, while a handler returned"},
    {kBusStacking, "bus error, while a handler was entered"},
    {kBusStackingFloat, "bus error, while floating-point state was saved"},
    {1U << 16, "undefined instruction"},
    {1U << 17, "a jump to an address that is no Thumb code"},
    {1U << 18, "a handler returned to where it may not"},
    {1U << 19, "coprocessor or FPU without access"},
    {kStackLimit, "stack limit"},
    {1U << 24, "unaligned access"},
    {1U << 25, "division by zero"},
}};

inline constexpr std::array<FaultBit, 3> kHardFaultBits{{
    {1U << 1, "the vector table could not be read"},
    {1U << 30, "raised because its own handler could not run"},
    {1U << 31, "a breakpoint without a debugger"},
}};

// Whether the address of the fault is in MMFAR or BFAR.
[[nodiscard]] constexpr bool has_memory_address(std::uint32_t cfsr) noexcept {
  return (cfsr & kMemoryAddressValid) != 0;
}
[[nodiscard]] constexpr bool has_bus_address(std::uint32_t cfsr) noexcept {
  return (cfsr & kBusAddressValid) != 0;
}

// The processor could not save the state of what it interrupted: whatever else, the stack was the
// reason.
[[nodiscard]] constexpr bool is_stacking(std::uint32_t cfsr) noexcept {
  return (cfsr & (kMemoryStacking | kMemoryStackingFloat | kBusStacking | kBusStackingFloat |
                  kStackLimit)) != 0;
}

// 0x and eight digits, for a console that prints characters.
[[nodiscard]] constexpr std::array<char, 10> hexadecimal(std::uint32_t value) noexcept {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::array<char, 10> text{'0', 'x'};
  for (std::size_t k = 0; k < 8; ++k) text[9 - k] = kDigits[(value >> (4 * k)) & 0xFU];
  return text;
}

// Tells `print` (called with std::string_view) everything that the registers know. `below_stack`
// says whether an address lies in the guard or below it.
template <class Print, class BelowStack>
void tell_fault(std::string_view handler, std::uint32_t cfsr, std::uint32_t hfsr,
                std::uint32_t mmfar, std::uint32_t bfar, const Print& print,
                const BelowStack& below_stack) {
  using namespace std::string_view_literals;
  const auto number = [&](std::string_view name, std::uint32_t value) {
    const auto digits = hexadecimal(value);
    print(name);
    print(std::string_view{digits.data(), digits.size()});
  };
  print("FAULT "sv);
  print(handler);
  number(", CFSR "sv, cfsr);
  number(", HFSR "sv, hfsr);
  if (has_memory_address(cfsr)) number(", MMFAR "sv, mmfar);
  if (has_bus_address(cfsr)) number(", BFAR "sv, bfar);
  print("\n"sv);
  for (const FaultBit& bit : kHardFaultBits) {
    if ((hfsr & bit.mask) == 0) continue;
    print("  "sv);
    print(bit.words);
    print("\n"sv);
  }
  for (const FaultBit& bit : kFaultBits) {
    if ((cfsr & bit.mask) == 0) continue;
    print("  "sv);
    print(bit.words);
    print("\n"sv);
  }
  const bool guard = (has_memory_address(cfsr) && below_stack(mmfar)) ||
                     (has_bus_address(cfsr) && below_stack(bfar)) || is_stacking(cfsr);
  if (guard) print("  the stack has overflowed into its guard\n"sv);
}

}  // namespace cutforce::hal::cortex_m
