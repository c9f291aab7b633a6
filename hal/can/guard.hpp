// The guard of the frames that move something: CRC-16 and a counter.
//
//   byte 0, 1   CRC-16 (polynomial 0x1021, start 0xFFFF, no reflection, no final xor), low byte
//               first, over the counter, the five bytes of payload, and the frame's 11-bit
//               identifier as two bytes, low byte first, which is not sent
//   byte 2      counter, one more with each frame, 255 is followed by 0
//
// It stops accidents, not attackers. Detects all errors of 1, 2 and 3 bits within the 8 bytes.
//
// What follows the last accepted frame by one is accepted. A repeated counter is refused. A counter
// that jumps is refused as well, and so is what follows it, until kTrust frames in a row follow
// one another: one stray or replayed frame among the sound ones disturbs nothing. A repeated frame
// leaves everything as it was.
//
// What a replay can do: any of the last 255 frames, alone or by twos between two live frames, is
// refused, and the live frames go on being taken. But a frame of 256 frames ago has the next
// counter and is taken in place of the live one; and kTrust successive old frames, while the live
// node is silent or between two of its frames, are taken as the node itself. An 8-bit counter
// cannot tell them from it: who can send on the bus has to be trusted.
#pragma once

#include <bit>
#include <cstdint>
#include <expected>
#include <span>
#include <type_traits>

#include "hal/can/frame.hpp"

namespace cutforce::hal::can {

enum class GuardError : std::uint8_t { kFormat, kCrc, kRepeated, kJump };

// Of any bytes, one after the other: what the CRC is.
[[nodiscard]] std::uint16_t crc16(std::span<const std::uint8_t> bytes) noexcept;

namespace detail {

// The remainder after two more bytes, the first of them in the higher eight bits of `pair`; what
// stands above its 16 bits does not matter. x becomes x X^16 - q P, whose 16 bits are those of
// q (X^12 + X^5 + 1). The quotient q has the bits of x/P X^16, and
// 1/P = X^-16 (1 + X^-4 + X^-8 + X^-11 + X^-12 + ...), the next term at X^-16.
// No table, and 7 instructions for 16 bits.
[[nodiscard]] constexpr std::uint32_t after_pair(std::uint32_t crc, std::uint32_t pair) noexcept {
  const std::uint32_t x = (crc ^ pair) & 0xFFFFU;
  std::uint32_t quotient = x ^ x >> 4U;
  quotient ^= quotient >> 8U;
  quotient ^= x >> 11U;
  return quotient ^ quotient << 5U ^ quotient << 12U;
}

// Of a frame's eight bytes, the first one lowest, and its identifier.
[[nodiscard]] constexpr std::uint32_t guard_crc(std::uint64_t data, std::uint32_t id) noexcept {
  const std::uint32_t begin = std::byteswap(static_cast<std::uint32_t>(data));
  const std::uint32_t end = std::byteswap(static_cast<std::uint32_t>(data >> 32U));
  std::uint32_t crc = after_pair(0xFFFFU, begin);
  crc = after_pair(crc, end >> 16U);
  crc = after_pair(crc, end);
  return after_pair(crc, std::byteswap(static_cast<std::uint16_t>(id))) & 0xFFFFU;
}

}  // namespace detail

// The same bytes with their counter and their CRC.
[[nodiscard]] constexpr std::uint64_t sealed(std::uint64_t data, std::uint32_t id,
                                             std::uint8_t counter) noexcept {
  const std::uint64_t counted = (data & ~std::uint64_t{0xFF'FF'FF}) | std::uint64_t{counter} << 16U;
  return counted | detail::guard_crc(counted, id);
}

// Fills in bytes 0..2; id and payload are there.
inline void seal(Frame& frame, std::uint8_t counter) noexcept {
  put_word(frame.data, sealed(word_of(frame.data), frame.id, counter));
}

class GuardReceiver {
 public:
  static constexpr std::uint32_t kTrust = 3;

  struct State {
    std::uint32_t last = 0;       // counter of the last accepted frame
    std::uint32_t started = 0;    // 1: there is one
    std::uint32_t candidate = 0;  // counter of the last frame of the row that is not trusted yet
    std::uint32_t in_row = 0;     // frames in that row
  };

  // Checks format, CRC and counter; returns nothing iff the frame may be taken. The very first
  // frames have to be kTrust in a row too.
  [[nodiscard]] std::expected<void, GuardError> take(const Frame& frame) noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  State state_{};
};
static_assert(std::is_trivially_copyable_v<GuardReceiver>);

}  // namespace cutforce::hal::can
