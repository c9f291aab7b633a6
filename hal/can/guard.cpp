#include "hal/can/guard.hpp"

#include <cstddef>

namespace cutforce::hal::can {
namespace {

constexpr std::size_t kCounterByte = 2;

bool follows(std::uint32_t counter, std::uint32_t last) noexcept {
  return counter == ((last + 1U) & 0xFFU);
}

}  // namespace

std::uint16_t crc16(std::span<const std::uint8_t> bytes) noexcept {
  std::uint32_t crc = 0xFFFFU;
  for (const std::uint8_t byte : bytes) {
    std::uint32_t quotient = crc >> 8U ^ byte;  // as for a pair, of which eight bits are left
    quotient ^= quotient >> 4U;
    crc = (crc << 8U ^ quotient << 12U ^ quotient << 5U ^ quotient) & 0xFFFFU;
  }
  return static_cast<std::uint16_t>(crc);
}

std::expected<void, GuardError> GuardReceiver::take(const Frame& frame) noexcept {
  if (frame.extended || frame.remote || frame.length != 8 || frame.id > 0x7FFU) {
    return std::unexpected{GuardError::kFormat};
  }
  const std::uint64_t data = word_of(frame.data);
  if ((data & 0xFFFFU) != detail::guard_crc(data, frame.id)) {
    return std::unexpected{GuardError::kCrc};
  }
  const std::uint32_t counter = frame.data[kCounterByte];
  if (state_.started != 0 && follows(counter, state_.last)) {
    state_.last = counter;
    state_.in_row = 0;
    return {};
  }
  // A controller may hear one frame twice, when the sender missed its acknowledgement. That takes
  // nothing from a row.
  if ((state_.started != 0 && counter == state_.last) ||
      (state_.in_row != 0 && counter == state_.candidate)) {
    return std::unexpected{GuardError::kRepeated};
  }
  const bool goes_on = state_.in_row != 0 && follows(counter, state_.candidate);
  state_.in_row = goes_on ? state_.in_row + 1U : 1U;
  state_.candidate = counter;
  if (state_.in_row < kTrust) return std::unexpected{GuardError::kJump};
  state_ = {.last = counter, .started = 1, .candidate = counter, .in_row = 0};
  return {};
}

}  // namespace cutforce::hal::can
