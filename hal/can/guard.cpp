#include "hal/can/guard.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

namespace cutforce::hal::can {
namespace {

constexpr std::size_t kCounterByte = 2;

// What four bits do to the remainder. A table for eight would be 512 bytes for a frame each 20 ms.
constexpr std::array<std::uint16_t, 16> remainders() noexcept {
  std::array<std::uint16_t, 16> table{};
  for (std::uint32_t bits = 0; bits < table.size(); ++bits) {
    std::uint32_t crc = bits << 12U;
    for (int k = 0; k < 4; ++k) crc = (crc << 1U) ^ ((crc & 0x8000U) != 0 ? 0x11021U : 0U);
    table[bits] = static_cast<std::uint16_t>(crc);
  }
  return table;
}
constexpr auto kRemainders = remainders();

std::uint16_t crc_of(const Frame& frame) noexcept {
  std::array<std::uint8_t, 8> covered{};
  std::copy(frame.data.begin() + kCounterByte, frame.data.end(), covered.begin());
  covered[6] = static_cast<std::uint8_t>(frame.id);
  covered[7] = static_cast<std::uint8_t>(frame.id >> 8U);
  return crc16(covered);
}

bool follows(std::uint32_t counter, std::uint32_t last) noexcept {
  return counter == ((last + 1U) & 0xFFU);
}

}  // namespace

std::uint16_t crc16(std::span<const std::uint8_t> bytes) noexcept {
  std::uint32_t crc = 0xFFFFU;
  for (const std::uint8_t byte : bytes) {
    crc = (crc << 4U & 0xFFFFU) ^ kRemainders[crc >> 12U ^ byte >> 4U];
    crc = (crc << 4U & 0xFFFFU) ^ kRemainders[crc >> 12U ^ (byte & 0xFU)];
  }
  return static_cast<std::uint16_t>(crc);
}

void seal(Frame& frame, std::uint8_t counter) noexcept {
  frame.data[kCounterByte] = counter;
  const std::uint16_t crc = crc_of(frame);
  frame.data[0] = static_cast<std::uint8_t>(crc);
  frame.data[1] = static_cast<std::uint8_t>(crc >> 8U);
}

std::expected<void, GuardError> GuardReceiver::take(const Frame& frame) noexcept {
  if (frame.extended || frame.remote || frame.length != 8 || frame.id > 0x7FFU) {
    return std::unexpected{GuardError::kFormat};
  }
  const std::uint16_t crc = crc_of(frame);
  if (frame.data[0] != (crc & 0xFFU) || frame.data[1] != crc >> 8U) {
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
