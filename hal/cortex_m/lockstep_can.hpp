// The board's CAN port where the bus is a UART in lockstep (hal/lockstep_frames.hpp): frames wait
// here until the tick that they belong to. Until a byte comes the processor sleeps: one that asks
// again and again leaves QEMU little time to bring it.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>

#include "hal/can_port.hpp"
#include "hal/cortex_m/uart.hpp"
#include "hal/lockstep_frames.hpp"

namespace cutforce::hal::cortex_m {

// `R` are the UART's registers, `S` those of the core.
template <RegisterBlock R, RegisterBlock S>
class LockstepCan {
 public:
  static constexpr std::size_t kMostFrames = 8;

  LockstepCan(R uart, S system, std::uint32_t interrupt) noexcept
      : uart_(uart), system_(system), interrupt_(interrupt) {}

  // `divider` as CmsdkUart::start().
  void start(std::uint32_t divider) noexcept {
    uart_.start(divider);
    // It wakes the processor and is never served.
    asm volatile("cpsid i" ::: "memory");
    system_.store(kInterruptEnable + 4 * (interrupt_ / 32), 1U << interrupt_ % 32);
    uart_.call_on_receive();
    tell(LockstepRecord::kListening);
  }

  void read(std::span<std::byte> bytes) noexcept {
    for (std::byte& byte : bytes) byte = std::byte{get()};
  }
  void tell(LockstepRecord record) noexcept { uart_.send(static_cast<char>(record)); }

  // Takes what comes up to the next tick, and returns its time. Nothing at the end. Fails with
  // kMalformed on what is no record, and on more frames than a step can have.
  [[nodiscard]] std::expected<std::optional<std::int64_t>, PortError> wait_for_tick() noexcept {
    for (count_ = 0;;) {
      switch (static_cast<LockstepRecord>(get())) {
        case LockstepRecord::kFrame: {
          if (count_ == kMostFrames) return std::unexpected{PortError::kMalformed};
          LockstepFrameBytes bytes{};
          read(std::as_writable_bytes(std::span(bytes)));
          frames_[count_++] = lockstep_frame(bytes);
          break;
        }
        case LockstepRecord::kTick: {
          LockstepTimeBytes bytes{};
          read(std::as_writable_bytes(std::span(bytes)));
          return std::bit_cast<std::int64_t>(bytes);
        }
        case LockstepRecord::kEnd:
          return std::nullopt;
        case LockstepRecord::kListening:
        case LockstepRecord::kReady:
        case LockstepRecord::kRefused:
        default:
          return std::unexpected{PortError::kMalformed};
      }
    }
  }

  [[nodiscard]] std::expected<std::size_t, PortError> receive(
      std::span<can::Frame> frames) noexcept {
    const std::size_t count = std::min(count_, frames.size());
    std::copy_n(frames_.begin(), count, frames.begin());
    std::copy(frames_.begin() + count, frames_.begin() + count_, frames_.begin());
    count_ -= count;
    return count;
  }
  [[nodiscard]] std::expected<void, SendError> send(const can::Frame& frame) noexcept {
    tell(LockstepRecord::kFrame);
    for (const std::uint8_t byte : lockstep_bytes(frame)) uart_.send(static_cast<char>(byte));
    return {};
  }
  [[nodiscard]] BusStatus status() const noexcept {
    return {.state = BusState::kActive,
            .acknowledged = true,
            .restarts = 0,
            .unsent = 0,
            .overrun = 0,
            .error_frames = 0};
  }

 private:
  [[nodiscard]] std::uint8_t get() noexcept {
    for (;;) {
      // In this order: what comes after the question wakes from the sleep.
      uart_.quiet();
      system_.store(kInterruptClearPending + 4 * (interrupt_ / 32), 1U << interrupt_ % 32);
      if (const auto byte = uart_.receive()) return *byte;
      asm volatile("wfi" ::: "memory");
    }
  }

  CmsdkUart<R> uart_;
  S system_;
  std::uint32_t interrupt_;
  std::array<can::Frame, kMostFrames> frames_{};
  std::size_t count_ = 0;
};
static_assert(CanPort<LockstepCan<MappedRegisters, MappedRegisters>>);

}  // namespace cutforce::hal::cortex_m
