// UART of Arm's Cortex-M System Design Kit: one character in, one out, polled.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "hal/cortex_m/registers.hpp"

namespace cutforce::hal::cortex_m {

template <RegisterBlock R>
class CmsdkUart {
 public:
  explicit constexpr CmsdkUart(R registers) noexcept : registers_(registers) {}

  // `divider` is clock over baud rate, at least 16.
  void start(std::uint32_t divider) noexcept {
    registers_.store(kDivider, divider);
    registers_.store(kControl, kTransmit | kReceive);
    // QEMU asks for the next character only once the last was fetched, also for the very first.
    static_cast<void>(registers_.load(kData));
  }

  // From now on a character that has come asks for an interrupt, until quiet().
  void call_on_receive() noexcept {
    registers_.store(kControl, kTransmit | kReceive | kReceiveInterrupt);
  }
  void quiet() noexcept { registers_.store(kInterrupt, kReceivePending); }

  void send(char character) noexcept {
    while ((registers_.load(kState) & kTransmitFull) != 0) {
    }
    registers_.store(kData, static_cast<std::uint8_t>(character));
  }
  void send(std::string_view text) noexcept {
    for (const char character : text) send(character);
  }

  // Nothing where nothing has come.
  [[nodiscard]] std::optional<std::uint8_t> receive() noexcept {
    if ((registers_.load(kState) & kReceiveFull) == 0) return std::nullopt;
    return static_cast<std::uint8_t>(registers_.load(kData));
  }

 private:
  static constexpr std::size_t kData = 0x00;
  static constexpr std::size_t kState = 0x04;
  static constexpr std::size_t kControl = 0x08;
  static constexpr std::size_t kInterrupt = 0x0C;
  static constexpr std::size_t kDivider = 0x10;
  static constexpr std::uint32_t kTransmitFull = 1U << 0;
  static constexpr std::uint32_t kReceiveFull = 1U << 1;
  static constexpr std::uint32_t kTransmit = 1U << 0;
  static constexpr std::uint32_t kReceive = 1U << 1;
  static constexpr std::uint32_t kReceiveInterrupt = 1U << 3;
  static constexpr std::uint32_t kReceivePending = 1U << 1;

  R registers_;
};

}  // namespace cutforce::hal::cortex_m
