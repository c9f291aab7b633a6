// The override byte on the pins of one port: hal::BytePort by register writes.
//
// All eight data lines change with one store, so no receiver ever sees half of an old byte; the
// strobe follows after the set-up time, and the byte stands until the hold time is over.
//
//   pins 0-7 data, 8 strobe, 9 alive, 10 alarm; inputs: 11 acknowledge, 12 inhibit
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>

#include "hal/byte_port.hpp"
#include "hal/cortex_m/registers.hpp"

namespace cutforce::hal::cortex_m {

// How a family of parts sets some pins of a port and leaves the others alone, without reading them.

// STM32: BSRR, one store for all sixteen pins. RM0410 "GPIO port bit set/reset register".
struct Stm32Pins {
  template <RegisterBlock R>
  static void set(R& port, std::uint32_t mask, std::uint32_t value) noexcept {
    constexpr std::size_t kSetReset = 0x18;
    port.store(kSetReset, (value & mask) | ((~value & mask) << 16));
  }
  template <RegisterBlock R>
  [[nodiscard]] static std::uint32_t get(R& port) noexcept {
    constexpr std::size_t kInput = 0x10;
    return port.load(kInput);
  }
};

// Arm's Cortex-M System Design Kit: the mask is part of the address, one store for eight pins.
struct CmsdkPins {
  template <RegisterBlock R>
  static void set(R& port, std::uint32_t mask, std::uint32_t value) noexcept {
    constexpr std::size_t kLowByte = 0x400;
    constexpr std::size_t kHighByte = 0x800;
    if ((mask & 0xFFU) != 0) port.store(kLowByte + 4 * (mask & 0xFFU), value & 0xFFU);
    if ((mask >> 8) != 0) port.store(kHighByte + 4 * (mask >> 8), value & 0xFF00U);
  }
  template <RegisterBlock R>
  [[nodiscard]] static std::uint32_t get(R& port) noexcept {
    return port.load(0x00);
  }
};

struct BytePinsConfig {
  std::uint32_t setup_ns;
  std::uint32_t hold_ns;
  bool strobe_high;  // the strobe's active level
  bool acknowledge;  // there is such a line
  bool inhibit;
};

// `Wait` is called with nanoseconds and returns not before they have passed.
template <class Pins, RegisterBlock R, class Wait>
class BytePins {
 public:
  constexpr BytePins(R port, Wait wait, const BytePinsConfig& config) noexcept
      : port_(port), wait_(wait), config_(config) {}

  [[nodiscard]] std::expected<ByteInput, PortError> write(const ByteOutput& output) noexcept {
    Pins::set(port_, kAlive | kAlarm, (output.alive ? kAlive : 0U) | (output.alarm ? kAlarm : 0U));
    if (!written_ || output.again || output.byte != last_) {
      if (!written_) strobe(false);
      Pins::set(port_, kData, output.byte);
      wait_(config_.setup_ns);
      strobe(true);
      wait_(config_.hold_ns);
      strobe(false);
      last_ = output.byte;
      written_ = true;
    }
    const std::uint32_t lines = Pins::get(port_);
    return ByteInput{.acknowledged = !config_.acknowledge || (lines & kAcknowledge) != 0,
                     .inhibit = config_.inhibit && (lines & kInhibit) != 0};
  }

 private:
  static constexpr std::uint32_t kData = 0xFF;
  static constexpr std::uint32_t kStrobe = 1U << 8;
  static constexpr std::uint32_t kAlive = 1U << 9;
  static constexpr std::uint32_t kAlarm = 1U << 10;
  static constexpr std::uint32_t kAcknowledge = 1U << 11;
  static constexpr std::uint32_t kInhibit = 1U << 12;

  void strobe(bool active) noexcept {
    Pins::set(port_, kStrobe, active == config_.strobe_high ? kStrobe : 0U);
  }

  R port_;
  Wait wait_;
  BytePinsConfig config_;
  std::uint8_t last_ = 0;
  bool written_ = false;
};

}  // namespace cutforce::hal::cortex_m
