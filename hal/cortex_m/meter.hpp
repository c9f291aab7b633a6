// Instructions of a call, counted by the core's own timer where every instruction takes the same
// time (QEMU -icount). Calibrated with nops, so that no clock rate is assumed; exact to the
// instruction for calls of up to 600 000. On silicon the same code measures time, not instructions.
#pragma once

#include <cstdint>
#include <type_traits>

#include "hal/cortex_m/registers.hpp"

namespace cutforce::hal::cortex_m {

class Meter {
 public:
  Meter() noexcept {
    constexpr std::uint32_t kEnabledByProcessorClock = 5;
    kSystemControl.store(kSysTickReload, kMask);
    kSystemControl.store(kSysTickValue, 0);
    kSystemControl.store(kSysTickControl, kEnabledByProcessorClock);
    const auto nothing = [] {};
    const auto nops = [] { asm volatile(".rept 4000\n\tnop\n\t.endr"); };
    // The first pass lets the emulator translate.
    for (int pass = 0; pass < 2; ++pass) {
      empty_ticks_ = ticks(nothing);
      ticks_for_nops_ = ticks(nops) - empty_ticks_;
    }
  }

  // What the call costs less the call and the return: of an empty function it is 0.
  template <class Body>
  [[nodiscard]] std::uint32_t count(Body&& body) noexcept {
    constexpr std::uint32_t kNops = 4000;
    const std::uint32_t used = ticks(body);
    if (used <= empty_ticks_) return 0;  // a reading may be one tick off
    return static_cast<std::uint32_t>(
        (std::uint64_t{used - empty_ticks_} * kNops + ticks_for_nops_ / 2) / ticks_for_nops_);
  }

 private:
  static constexpr std::uint32_t kMask = 0x00FF'FFFF;

  template <class Body>
  [[gnu::noinline]] static void call(Body& body) noexcept {
    body();
    asm volatile("" ::: "memory");
  }
  // One text for all bodies: what surrounds the call is the same each time.
  template <class Body>
  [[nodiscard]] static std::uint32_t ticks(Body& body) noexcept {
    return ticks_of(
        [](void* erased) noexcept { call(*static_cast<std::remove_reference_t<Body>*>(erased)); },
        const_cast<void*>(static_cast<const void*>(&body)));
  }
  [[gnu::noinline]] static std::uint32_t ticks_of(void (*called)(void*) noexcept,
                                                  void* body) noexcept {
    const std::uint32_t before = kSystemControl.load(kSysTickValue);
    called(body);
    return (before - kSystemControl.load(kSysTickValue)) & kMask;
  }

  std::uint32_t empty_ticks_ = 0;
  std::uint32_t ticks_for_nops_ = 1;
};

}  // namespace cutforce::hal::cortex_m
