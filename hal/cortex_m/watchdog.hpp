// Watchdog of Arm's Cortex-M System Design Kit: once it has run down it raises the NMI, which is
// named like a fault; once it has run down again it resets the board. Fed by whoever has just
// finished a control tick, and by nobody else.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/cortex_m/registers.hpp"

namespace cutforce::hal::cortex_m {

template <RegisterBlock R>
class CmsdkWatchdog {
 public:
  explicit constexpr CmsdkWatchdog(R registers) noexcept : registers_(registers) {}

  void start(std::uint32_t ticks) noexcept {
    registers_.store(kLock, kUnlockKey);
    registers_.store(kLoad, ticks);
    registers_.store(kControl, kInterrupt | kReset);
    registers_.store(kLock, kLocked);
  }
  void feed() noexcept {
    registers_.store(kLock, kUnlockKey);
    registers_.store(kClear, 1);  // and loads it anew
    registers_.store(kLock, kLocked);
  }
  [[nodiscard]] std::uint32_t left_ticks() noexcept { return registers_.load(kValue); }

 private:
  static constexpr std::size_t kLoad = 0x000;
  static constexpr std::size_t kValue = 0x004;
  static constexpr std::size_t kControl = 0x008;
  static constexpr std::size_t kClear = 0x00C;
  static constexpr std::size_t kLock = 0xC00;
  static constexpr std::uint32_t kInterrupt = 1U << 0;
  static constexpr std::uint32_t kReset = 1U << 1;
  static constexpr std::uint32_t kUnlockKey = 0x1ACCE551;
  static constexpr std::uint32_t kLocked = 1;

  R registers_;
};

}  // namespace cutforce::hal::cortex_m
