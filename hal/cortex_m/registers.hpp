// Memory-mapped registers, one load or store each. Drivers take them as a type, so that a test
// gives them a block that behaves (host_tests), and the image the hardware:
//
//   template <RegisterBlock R> class CmsdkUart ...      CmsdkUart<MappedRegisters> uart{{kUart0}};
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>

namespace cutforce::hal::cortex_m {

// Offsets are in bytes from the block's begin, multiples of 4.
template <class R>
concept RegisterBlock = requires(R& block, std::size_t offset, std::uint32_t value) {
  { block.load(offset) } -> std::same_as<std::uint32_t>;
  { block.store(offset, value) } -> std::same_as<void>;
};

class MappedRegisters {
 public:
  explicit constexpr MappedRegisters(std::uintptr_t address) noexcept : address_(address) {}

  [[nodiscard]] std::uint32_t load(std::size_t offset) const noexcept {
    return *reinterpret_cast<const volatile std::uint32_t*>(address_ + offset);
  }
  void store(std::size_t offset, std::uint32_t value) const noexcept {
    *reinterpret_cast<volatile std::uint32_t*>(address_ + offset) = value;
  }

 private:
  std::uintptr_t address_;
};
static_assert(RegisterBlock<MappedRegisters>);

// The core's own registers are one block as well: the System Control Space of Arm v7-M and v8-M.
inline constexpr MappedRegisters kSystemControl{0xE000E000U};

// Offsets in it.
inline constexpr std::size_t kSysTickControl = 0x010;
inline constexpr std::size_t kSysTickReload = 0x014;
inline constexpr std::size_t kSysTickValue = 0x018;
inline constexpr std::size_t kInterruptEnable = 0x100;        // NVIC_ISER0; a bit each
inline constexpr std::size_t kInterruptClearPending = 0x280;  // NVIC_ICPR0
inline constexpr std::size_t kCpuid = 0xD00;
inline constexpr std::size_t kConfigurationControl = 0xD14;
inline constexpr std::size_t kHandlerControl = 0xD24;
inline constexpr std::size_t kFaultStatus = 0xD28;       // CFSR
inline constexpr std::size_t kHardFaultStatus = 0xD2C;   // HFSR
inline constexpr std::size_t kMemManageAddress = 0xD34;  // MMFAR
inline constexpr std::size_t kBusFaultAddress = 0xD38;   // BFAR
inline constexpr std::size_t kCoprocessorAccess = 0xD88;
inline constexpr std::size_t kMpuControl = 0xD94;
inline constexpr std::size_t kMpuNumber = 0xD98;
inline constexpr std::size_t kMpuBase = 0xD9C;
inline constexpr std::size_t kMpuAttributes = 0xDA0;  // v8-M: RLAR
inline constexpr std::size_t kMpuMemoryType = 0xDC0;  // v8-M only: MAIR0

}  // namespace cutforce::hal::cortex_m
