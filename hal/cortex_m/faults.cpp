#include "hal/cortex_m/faults.hpp"

#include <array>
#include <cstdint>
#include <string_view>

#include "hal/cortex_m/console.hpp"
#include "hal/cortex_m/fault_text.hpp"
#include "hal/cortex_m/registers.hpp"
#include "hal/cortex_m/stack.hpp"

namespace cutforce::hal::cortex_m {
namespace {

using namespace std::string_view_literals;  // their lengths are known here: no strlen()

constexpr int kFaultStatus_exit = 99;
constexpr int kAbandonedStatus_exit = 98;

enum class Handler : std::uint32_t { kNmi, kHard, kMemory, kBus, kUsage, kSecure, kInterrupt };
constexpr std::array<std::string_view, 7> kHandlerNames{
    "NMI (watchdog)", "hard fault",   "memory fault",        "bus fault",
    "usage fault",    "secure fault", "unexpected interrupt"};

// What the processor saves of what it interrupts, at the stack pointer.
struct SavedState {
  std::array<std::uint32_t, 4> r0_to_r3;
  std::uint32_t r12;
  std::uint32_t return_address;
  std::uint32_t place;
  std::uint32_t status;
};

}  // namespace

// What the handlers stand on. Its size is checked with the other stacks (toolchain/cortex_m).
extern "C" {
alignas(8) std::array<std::uint32_t, 64> fault_stack;
[[noreturn, gnu::used]] void tell_and_stop(std::uint32_t handler, const SavedState* saved);
}

void tell_and_stop(std::uint32_t handler, const SavedState* saved) {
  const std::uint32_t status = kSystemControl.load(kFaultStatus);
  tell_fault(
      kHandlerNames[handler], status, kSystemControl.load(kHardFaultStatus),
      kSystemControl.load(kMemManageAddress), kSystemControl.load(kBusFaultAddress),
      [](std::string_view text) { console::write(text); },
      [](std::uint32_t address) { return is_below_stack(address); });
  // Below the stack nothing was saved, and reading there would be the next fault.
  if (!is_stacking(status) && !is_below_stack(reinterpret_cast<std::uint32_t>(saved))) {
    const auto place = hexadecimal(saved->place);
    const auto caller = hexadecimal(saved->return_address);
    console::write("  at "sv);
    console::write({place.data(), place.size()});
    console::write(", which returns to "sv);
    console::write({caller.data(), caller.size()});
    console::write("\n"sv);
  }
  console::stop(kFaultStatus_exit);
}

void stop_abandoned() noexcept {
  console::write("FAULT abandoned: abort, or the image ended\n"sv);
  console::stop(kAbandonedStatus_exit);
}

void enable_faults() noexcept {
  constexpr std::uint32_t kDivisionByZero = 1U << 4;
  constexpr std::uint32_t kMemoryBusUsage = 7U << 16;
  kSystemControl.store(kConfigurationControl,
                       kSystemControl.load(kConfigurationControl) | kDivisionByZero);
  kSystemControl.store(kHandlerControl, kSystemControl.load(kHandlerControl) | kMemoryBusUsage);
}

// A handler must not touch the stack that it was entered on, so none of this may be compiled code.
#define CUTFORCE_FAULT_HANDLER(name, number)                 \
  extern "C" [[gnu::naked]] void name() {                    \
    asm volatile(                                            \
        "mov r1, sp\n\t"                                     \
        "ldr r0, =fault_stack + 256\n\t"                     \
        "mov sp, r0\n\t"                                     \
        "mov r0, %0\n\t"                                     \
        "b tell_and_stop\n\t"                                \
        ".ltorg" ::"I"(static_cast<std::uint32_t>(number))); \
  }

CUTFORCE_FAULT_HANDLER(nmi_handler, Handler::kNmi)
CUTFORCE_FAULT_HANDLER(hard_fault_handler, Handler::kHard)
CUTFORCE_FAULT_HANDLER(memory_fault_handler, Handler::kMemory)
CUTFORCE_FAULT_HANDLER(bus_fault_handler, Handler::kBus)
CUTFORCE_FAULT_HANDLER(usage_fault_handler, Handler::kUsage)
CUTFORCE_FAULT_HANDLER(secure_fault_handler, Handler::kSecure)
CUTFORCE_FAULT_HANDLER(interrupt_fault_handler, Handler::kInterrupt)

#undef CUTFORCE_FAULT_HANDLER

}  // namespace cutforce::hal::cortex_m
