// From reset to image_main(): vector table, FPU, memory, and the few hooks that a build without
// exceptions, type information and static destructors still refers to.
#include <array>
#include <cstdint>

#include "hal/cortex_m/faults.hpp"
#include "hal/cortex_m/packed_data.hpp"
#include "hal/cortex_m/registers.hpp"
#include "hal/cortex_m/stack.hpp"

extern "C" {

// The linker script's; only their addresses mean anything.
extern std::uint32_t data_begin[];
extern std::uint32_t data_end[];
extern const std::uint8_t packed_data[];
extern std::uint32_t bss_begin[];
extern std::uint32_t bss_end[];
extern std::uint32_t stack_end[];

int image_main();
[[noreturn]] void reset_handler();
void timer_handler();

// Statics are never destroyed: no image ends.
void* __dso_handle = nullptr;
int __aeabi_atexit(void*, void (*)(void*), void*) { return 0; }
[[noreturn]] void __cxa_pure_virtual() { cutforce::hal::cortex_m::stop_abandoned(); }
[[noreturn]] void abort() { cutforce::hal::cortex_m::stop_abandoned(); }

// An image that uses the timer's interrupt defines its own.
[[gnu::weak]] void timer_handler() {}

}  // extern "C"

namespace cutforce::hal::cortex_m {
namespace {

using Handler = void (*)();

struct Vectors {
  const std::uint32_t* stack;
  std::array<Handler, 15> system;
  std::array<Handler, 32> interrupts;
};

constexpr std::array<Handler, 32> interrupt_handlers() noexcept {
  std::array<Handler, 32> handlers{};
  for (Handler& handler : handlers) handler = &interrupt_fault_handler;
  return handlers;
}

[[gnu::section(".vectors"), gnu::used]] constexpr Vectors kVectors{
    .stack = stack_end,
    .system = {&reset_handler, &nmi_handler, &hard_fault_handler, &memory_fault_handler,
               &bus_fault_handler, &usage_fault_handler, &secure_fault_handler, nullptr, nullptr,
               nullptr, &interrupt_fault_handler, &interrupt_fault_handler, nullptr,
               &interrupt_fault_handler, &timer_handler},
    .interrupts = interrupt_handlers()};

}  // namespace
}  // namespace cutforce::hal::cortex_m

// The loops must stay loops: memcpy() and memset() may use what they set up.
extern "C" [[gnu::optimize("no-tree-loop-distribute-patterns")]] void reset_handler() {
  using namespace cutforce::hal::cortex_m;
  constexpr std::uint32_t kFullAccess = 0xFU << 20;  // CP10 and CP11: the FPU
  kSystemControl.store(kCoprocessorAccess, kSystemControl.load(kCoprocessorAccess) | kFullAccess);
  asm volatile("dsb\n\tisb" ::: "memory");
  unpack(packed_data, data_begin, data_end);
  for (std::uint32_t* word = bss_begin; word < bss_end; ++word) *word = 0;
  paint_stack();
  guard_stack();
  enable_faults();
  image_main();
  stop_abandoned();
}
