// One classic CAN frame, as a port takes and gives it. Identifier and length are whatever was on
// the bus: what they must be is the decoder's to say.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace cutforce::hal::can {

struct Frame {
  std::uint32_t id = 0;  // 11 bits, 29 where extended
  std::uint8_t length = 0;
  bool extended = false;
  bool remote = false;
  bool own = false;  // heard back from this machine, not from another node
  std::array<std::uint8_t, 8> data{};

  friend constexpr bool operator==(const Frame&, const Frame&) noexcept = default;
};
static_assert(std::is_trivially_copyable_v<Frame>);

// The eight bytes as one number, the first one lowest, and back. Every target lays them so.
static_assert(std::endian::native == std::endian::little);
[[nodiscard]] constexpr std::uint64_t word_of(const std::array<std::uint8_t, 8>& bytes) noexcept {
  return std::bit_cast<std::uint64_t>(bytes);
}
[[nodiscard]] constexpr std::array<std::uint8_t, 8> bytes_of(std::uint64_t word) noexcept {
  return std::bit_cast<std::array<std::uint8_t, 8>>(word);
}
// Where it stays: without a copy on the stack.
inline void put_word(std::array<std::uint8_t, 8>& bytes, std::uint64_t word) noexcept {
  std::memcpy(bytes.data(), &word, sizeof word);
}

}  // namespace cutforce::hal::can
