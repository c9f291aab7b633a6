// The CAN controller of STM32 parts with "bxCAN" (F1 to F4, F7, L4), behind hal::CanPort. Written
// against ST's RM0090 (STM32F4), chapter 32 "Controller area network (bxCAN)"; RM0410 (STM32F7 with
// a Cortex-M7) has the same block in chapter 40. Proved on the host against registers that behave
// as the chapter says; NOT YET RUN ON SILICON, and no emulator here has it.
//
// Nothing waits for ever: entering and leaving initialisation is given `kPatience` looks at the
// acknowledge bit. Frames leave in the order in which they were given (TXFP), through three
// mailboxes; none is queued behind them. Both receive FIFOs are read; a filter takes every frame,
// for what is foreign has to be seen to be told.
//
// The pins, the clock and the peripheral's reset are the board's to set before start().
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>

#include "hal/can_port.hpp"
#include "hal/cortex_m/registers.hpp"

namespace cutforce::hal::cortex_m {

// Bit time in quanta: 1 + segment_1 + segment_2; a quantum is `prescaler` peripheral clocks.
struct BxCanTiming {
  std::uint32_t prescaler;  // 1..1024
  std::uint32_t segment_1;  // 1..16
  std::uint32_t segment_2;  // 1..8
  std::uint32_t jump;       // 1..4

  [[nodiscard]] constexpr bool check() const noexcept {
    return prescaler >= 1 && prescaler <= 1024 && segment_1 >= 1 && segment_1 <= 16 &&
           segment_2 >= 1 && segment_2 <= 8 && jump >= 1 && jump <= 4 && jump <= segment_2;
  }
  [[nodiscard]] constexpr std::uint32_t rate_hz(std::uint32_t clock_hz) const noexcept {
    return clock_hz / (prescaler * (1 + segment_1 + segment_2));
  }
};

enum class BxCanError : std::uint8_t {
  kTiming,    // outside what the registers hold
  kNoAnswer,  // the controller does not enter initialisation: no clock, or it is not there
  kBusStuck,  // it does not leave initialisation: no eleven recessive bits on the bus
};

template <RegisterBlock R>
class BxCan {
 public:
  static constexpr std::uint32_t kPatience = 100'000;

  explicit constexpr BxCan(R registers) noexcept : registers_(registers) {}

  // Also starts it again after bus-off: what waited to be sent is given up.
  [[nodiscard]] std::expected<void, BxCanError> start(const BxCanTiming& timing) noexcept {
    if (!timing.check()) return std::unexpected{BxCanError::kTiming};
    // SLEEP, set by a reset, is cleared too: a controller that sleeps does not answer.
    registers_.store(kMasterControl, kInitRequest | kTransmitInOrder);
    if (!waits_for(kInitAcknowledge)) return std::unexpected{BxCanError::kNoAnswer};
    registers_.store(kTransmitStatus, kAbortAll);
    registers_.store(kBitTiming, (timing.jump - 1) << 24 | (timing.segment_2 - 1) << 20 |
                                     (timing.segment_1 - 1) << 16 | (timing.prescaler - 1));
    accept_everything();
    registers_.store(kInterrupts, 0);  // polled
    registers_.store(kErrorStatus, kSetBySoftware << kLastErrorAt);
    registers_.store(kMasterControl, kTransmitInOrder);
    if (!waits_for(0)) return std::unexpected{BxCanError::kBusStuck};
    if (started_) ++restarts_;
    started_ = true;
    return {};
  }

  [[nodiscard]] std::expected<std::size_t, PortError> receive(
      std::span<can::Frame> frames) noexcept {
    std::size_t count = 0;
    for (std::size_t fifo = 0; fifo < 2; ++fifo) {
      while (count < frames.size() && take(fifo, frames[count])) ++count;
      note_overrun(fifo);
    }
    note_error();
    return count;
  }

  [[nodiscard]] std::expected<void, SendError> send(const can::Frame& frame) noexcept {
    note_error();
    if (!started_ || (registers_.load(kMasterStatus) & kInitAcknowledge) != 0 ||
        (registers_.load(kErrorStatus) & kBusOff) != 0) {
      return std::unexpected{SendError::kDown};
    }
    const std::uint32_t status = registers_.load(kTransmitStatus);
    if ((status & kAnyEmpty) == 0) {
      ++unsent_;
      return std::unexpected{SendError::kNoRoom};
    }
    const std::size_t box = kMailboxes + kMailboxSize * ((status >> kNextFreeAt) & 3U);
    registers_.store(box + kLengthAt, frame.length <= 8U ? frame.length : 8U);
    registers_.store(box + kLowDataAt, word(frame, 0));
    registers_.store(box + kHighDataAt, word(frame, 4));
    registers_.store(box, identifier(frame) | kRequest);  // last: it goes from here on
    return {};
  }

  [[nodiscard]] BusStatus status() noexcept {
    note_error();
    const std::uint32_t error = registers_.load(kErrorStatus);
    const bool down = !started_ || (registers_.load(kMasterStatus) & kInitAcknowledge) != 0;
    const BusState state = (error & kBusOff) != 0    ? BusState::kOff
                           : down                    ? BusState::kDown
                           : (error & kPassive) != 0 ? BusState::kPassive
                           : (error & kWarning) != 0 ? BusState::kWarning
                                                     : BusState::kActive;
    return {.state = state,
            .acknowledged = acknowledged_,
            .restarts = restarts_,
            .unsent = unsent_,
            .overrun = overrun_,
            .error_frames = error_frames_};
  }

 private:
  // 32.9.2 control and status registers
  static constexpr std::size_t kMasterControl = 0x000;
  static constexpr std::uint32_t kInitRequest = 1U << 0;
  static constexpr std::uint32_t kTransmitInOrder = 1U << 2;
  static constexpr std::size_t kMasterStatus = 0x004;
  static constexpr std::uint32_t kInitAcknowledge = 1U << 0;
  static constexpr std::uint32_t kSleepAcknowledge = 1U << 1;
  static constexpr std::size_t kTransmitStatus = 0x008;
  static constexpr std::uint32_t kAbortAll = 1U << 7 | 1U << 15 | 1U << 23;
  static constexpr std::uint32_t kCompleted = 1U << 0 | 1U << 8 | 1U << 16;    // RQCP
  static constexpr std::uint32_t kTransmitted = 1U << 1 | 1U << 9 | 1U << 17;  // TXOK
  static constexpr unsigned kNextFreeAt = 24;                                  // CODE
  static constexpr std::uint32_t kAnyEmpty = 7U << 26;
  static constexpr std::size_t kReceiveFifo = 0x00C;  // and 0x010
  static constexpr std::uint32_t kPending = 3U;
  static constexpr std::uint32_t kOverrun = 1U << 4;
  static constexpr std::uint32_t kRelease = 1U << 5;
  static constexpr std::size_t kInterrupts = 0x014;
  static constexpr std::size_t kErrorStatus = 0x018;
  static constexpr std::uint32_t kWarning = 1U << 0;
  static constexpr std::uint32_t kPassive = 1U << 1;
  static constexpr std::uint32_t kBusOff = 1U << 2;
  static constexpr unsigned kLastErrorAt = 4;
  static constexpr std::uint32_t kAcknowledgement = 3;
  static constexpr std::uint32_t kSetBySoftware = 7;
  static constexpr std::size_t kBitTiming = 0x01C;
  // 32.9.3 mailbox registers
  static constexpr std::size_t kMailboxes = 0x180;
  static constexpr std::size_t kFifoMailboxes = 0x1B0;
  static constexpr std::size_t kMailboxSize = 0x10;
  static constexpr std::size_t kLengthAt = 0x4;
  static constexpr std::size_t kLowDataAt = 0x8;
  static constexpr std::size_t kHighDataAt = 0xC;
  static constexpr std::uint32_t kRequest = 1U << 0;
  static constexpr std::uint32_t kRemote = 1U << 1;
  static constexpr std::uint32_t kExtended = 1U << 2;
  // 32.9.4 filter registers
  static constexpr std::size_t kFilterMaster = 0x200;
  static constexpr std::size_t kFilterMode = 0x204;
  static constexpr std::size_t kFilterScale = 0x20C;
  static constexpr std::size_t kFilterFifo = 0x214;
  static constexpr std::size_t kFilterActive = 0x21C;
  static constexpr std::size_t kFilterBank0 = 0x240;

  // INAK as wanted, and awake.
  [[nodiscard]] bool waits_for(std::uint32_t acknowledge) noexcept {
    for (std::uint32_t look = 0; look < kPatience; ++look) {
      const std::uint32_t status = registers_.load(kMasterStatus);
      if ((status & (kInitAcknowledge | kSleepAcknowledge)) == acknowledge) return true;
    }
    return false;
  }

  // Bank 0, a mask of 32 bits without a bit that has to match, into FIFO 0.
  void accept_everything() noexcept {
    constexpr std::uint32_t kInit = 1U << 0;
    const std::uint32_t master = registers_.load(kFilterMaster);
    registers_.store(kFilterMaster, master | kInit);
    registers_.store(kFilterActive, 0);
    registers_.store(kFilterMode, 0);
    registers_.store(kFilterScale, 1);
    registers_.store(kFilterFifo, 0);
    registers_.store(kFilterBank0, 0);
    registers_.store(kFilterBank0 + 4, 0);
    registers_.store(kFilterActive, 1);
    registers_.store(kFilterMaster, master & ~kInit);
  }

  [[nodiscard]] bool take(std::size_t fifo, can::Frame& frame) noexcept {
    const std::size_t control = kReceiveFifo + 4 * fifo;
    const std::uint32_t pending = registers_.load(control);
    // After a release the controller needs a moment to bring the next frame to the front.
    if ((pending & kPending) == 0 || (pending & kRelease) != 0) return false;
    const std::size_t box = kFifoMailboxes + kMailboxSize * fifo;
    const std::uint32_t id = registers_.load(box);
    frame = {};
    frame.extended = (id & kExtended) != 0;
    frame.remote = (id & kRemote) != 0;
    frame.id = frame.extended ? id >> 3 : id >> 21;
    const std::uint32_t length = registers_.load(box + kLengthAt) & 0xFU;
    frame.length = static_cast<std::uint8_t>(length <= 8U ? length : 8U);
    if (!frame.remote) {
      const std::uint32_t low = registers_.load(box + kLowDataAt);
      const std::uint32_t high = registers_.load(box + kHighDataAt);
      for (std::size_t k = 0; k < frame.length; ++k) {
        frame.data[k] = static_cast<std::uint8_t>((k < 4 ? low : high) >> (8 * (k % 4)));
      }
    }
    registers_.store(control, kRelease);
    return true;
  }

  void note_overrun(std::size_t fifo) noexcept {
    const std::size_t control = kReceiveFifo + 4 * fifo;
    if ((registers_.load(control) & kOverrun) == 0) return;
    ++overrun_;
    registers_.store(control, kOverrun);
  }

  // What has been sent since the last look, and what went wrong. The controller overwrites its last
  // error with each event; 7 marks it as read.
  void note_error() noexcept {
    const std::uint32_t sent = registers_.load(kTransmitStatus);
    if ((sent & kTransmitted) != 0) acknowledged_ = true;
    if ((sent & kCompleted) != 0) registers_.store(kTransmitStatus, sent & kCompleted);
    const std::uint32_t last = (registers_.load(kErrorStatus) >> kLastErrorAt) & 7U;
    if (last == kSetBySoftware || last == 0) return;
    ++error_frames_;
    if (last == kAcknowledgement) acknowledged_ = false;
    registers_.store(kErrorStatus, kSetBySoftware << kLastErrorAt);
  }

  [[nodiscard]] static std::uint32_t identifier(const can::Frame& frame) noexcept {
    return (frame.extended ? ((frame.id & 0x1FFF'FFFFU) << 3 | kExtended)
                           : (frame.id & 0x7FFU) << 21) |
           (frame.remote ? kRemote : 0U);
  }
  [[nodiscard]] static std::uint32_t word(const can::Frame& frame, std::size_t at) noexcept {
    std::uint32_t value = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      value |= static_cast<std::uint32_t>(frame.data[at + k]) << (8 * k);
    }
    return value;
  }

  R registers_;
  bool started_ = false;
  bool acknowledged_ = true;
  std::uint32_t restarts_ = 0;
  std::uint32_t unsent_ = 0;
  std::uint32_t overrun_ = 0;
  std::uint32_t error_frames_ = 0;
};
static_assert(CanPort<BxCan<MappedRegisters>>);

}  // namespace cutforce::hal::cortex_m
