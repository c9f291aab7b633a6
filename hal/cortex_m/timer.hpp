// Two timers: the core's own (SysTick), for a periodic interrupt on any Cortex-M, and that of Arm's
// Cortex-M System Design Kit, free running, for waiting a known while.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/cortex_m/registers.hpp"

namespace cutforce::hal::cortex_m {

inline constexpr std::uint32_t kSysTickLongest = 1U << 24;

// timer_handler() from now on, every `ticks` of the processor's clock; 2 to kSysTickLongest.
template <RegisterBlock R>
void start_sys_tick(R& system, std::uint32_t ticks) noexcept {
  constexpr std::uint32_t kEnable = 1U << 0;
  constexpr std::uint32_t kInterrupt = 1U << 1;
  constexpr std::uint32_t kProcessorClock = 1U << 2;
  system.store(kSysTickReload, ticks - 1);
  system.store(kSysTickValue, 0);
  system.store(kSysTickControl, kProcessorClock | kInterrupt | kEnable);
}

template <RegisterBlock R>
class CmsdkTimer {
 public:
  constexpr CmsdkTimer(R registers, std::uint32_t clock_hz) noexcept
      : registers_(registers),
        ticks_per_ns_(static_cast<std::uint32_t>(((std::uint64_t{clock_hz} << 32U) + 999'999'999U) /
                                                 1'000'000'000U)) {}

  void start() noexcept {
    constexpr std::uint32_t kEnable = 1U << 0;
    registers_.store(kReload, ~std::uint32_t{0});
    registers_.store(kValue, ~std::uint32_t{0});
    registers_.store(kControl, kEnable);
  }
  // Not before that many nanoseconds have passed; at most a second.
  void wait(std::uint32_t nanoseconds) noexcept {
    const std::uint32_t began = registers_.load(kValue);
    const auto ticks = static_cast<std::uint32_t>(
        (std::uint64_t{nanoseconds} * ticks_per_ns_ + ~std::uint32_t{0}) >> 32U);
    while (began - registers_.load(kValue) < ticks) {  // it counts down
    }
  }

 private:
  static constexpr std::size_t kControl = 0x0;
  static constexpr std::size_t kValue = 0x4;
  static constexpr std::size_t kReload = 0x8;

  R registers_;
  std::uint32_t ticks_per_ns_;  // in parts of 2^32, rounded up: below 1 for clocks up to 1 GHz
};

}  // namespace cutforce::hal::cortex_m
