// One classic CAN frame, as a port takes and gives it. Identifier and length are whatever was on
// the bus: what they must be is the decoder's to say.
#pragma once

#include <array>
#include <cstdint>
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

}  // namespace cutforce::hal::can
