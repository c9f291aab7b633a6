#include "hal/cortex_m/stack.hpp"

#include "hal/cortex_m/registers.hpp"

extern "C" {
extern std::uint32_t stack_guard_begin[];
extern std::uint32_t stack_begin[];
extern std::uint32_t stack_end[];
}

namespace cutforce::hal::cortex_m {
namespace {

constexpr std::uint32_t kPaint = 0x5AFE57AC;

std::uint32_t address_of(const std::uint32_t* symbol) noexcept {
  return reinterpret_cast<std::uint32_t>(symbol);
}

}  // namespace

[[gnu::optimize("no-tree-loop-distribute-patterns")]] void paint_stack() noexcept {
  std::uint32_t* pointer = nullptr;
  asm volatile("mov %0, sp" : "=r"(pointer));
  for (volatile std::uint32_t* word = stack_begin; word < pointer; ++word) *word = kPaint;
}

std::size_t stack_high_water() noexcept {
  const volatile std::uint32_t* word = stack_begin;
  while (word < stack_end && *word == kPaint) ++word;
  return address_of(stack_end) - reinterpret_cast<std::uint32_t>(word);
}

std::size_t stack_size() noexcept { return address_of(stack_end) - address_of(stack_begin); }

void guard_stack() noexcept {
  constexpr std::uint32_t kEnable = 1U << 0;
  constexpr std::uint32_t kDefaultMap = 1U << 2;  // PRIVDEFENA; faults themselves run without MPU
  const std::uint32_t begin = address_of(stack_guard_begin);
  kSystemControl.store(kMpuNumber, 0);
#if __ARM_ARCH >= 8
  // PMSAv8 knows no region without any access: read-only stops what a stack does.
  constexpr std::uint32_t kReadOnly = 2U << 1;
  constexpr std::uint32_t kNoExecution = 1U << 0;
  const std::uint32_t last = address_of(stack_begin) - 32U;
  kSystemControl.store(kMpuMemoryType, 0x44);  // normal memory, not cached
  kSystemControl.store(kMpuBase, begin | kReadOnly | kNoExecution);
  kSystemControl.store(kMpuAttributes, last | kEnable);
#else
  // No access, no execution. SIZE is the logarithm of the bytes, less one: 64 KiB.
  constexpr std::uint32_t kNoExecution = 1U << 28;
  constexpr std::uint32_t kSize = 15U << 1;
  kSystemControl.store(kMpuBase, begin);
  kSystemControl.store(kMpuAttributes, kNoExecution | kSize | kEnable);
#endif
  kSystemControl.store(kMpuControl, kDefaultMap | kEnable);
  asm volatile("dsb\n\tisb" ::: "memory");
}

bool is_below_stack(std::uint32_t address) noexcept {
  return address >= address_of(stack_guard_begin) && address < address_of(stack_begin);
}

}  // namespace cutforce::hal::cortex_m
