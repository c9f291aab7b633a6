// Frames over a wire of bytes, in lockstep: the machine's side says what was on the bus and which
// instant it is, the board answers with what it sends then, and only after that does time go on.
// So a board that is emulated, at whatever speed, answers as one that is a call.
//
//   board -> machine   kListening: what is said before may be lost
//   machine -> board   LockstepHello, the machine's parameters as they lie in memory
//   board -> machine   kReady or kRefused
//   machine -> board   kFrame + 11 bytes ..., kTick + 8 bytes (time, nanoseconds)   ... kEnd
//   board -> machine   kFrame + 11 bytes ..., kTick                                 ...
//
// A frame is its identifier (2 bytes), its length and its 8 bytes of data; everything is little
// endian. Not a format to keep: as sample_stream.hpp it goes with the build that wrote it.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "hal/can/frame.hpp"

namespace cutforce::hal {

struct LockstepHello {
  std::array<char, 8> magic;
  std::uint32_t machine_bytes;  // of the parameters that follow
  std::uint32_t node;
  float voltage_full_scale_v;  // of the acquisition node's frames
  float current_full_scale_a;

  static constexpr std::array<char, 8> kMagic{'l', 'o', 'c', 'k', 's', 't', 'p', '1'};
};
static_assert(std::is_trivially_copyable_v<LockstepHello> && sizeof(LockstepHello) == 24 &&
              std::endian::native == std::endian::little);

enum class LockstepRecord : std::uint8_t {
  kListening = 'L',
  kReady = 'R',
  kRefused = 'X',
  kFrame = 'F',
  kTick = 'T',
  kEnd = 'E',
};

using LockstepFrameBytes = std::array<std::uint8_t, 11>;
using LockstepTimeBytes = std::array<std::uint8_t, 8>;

[[nodiscard]] constexpr LockstepFrameBytes lockstep_bytes(const can::Frame& frame) noexcept {
  LockstepFrameBytes bytes{static_cast<std::uint8_t>(frame.id),
                           static_cast<std::uint8_t>(frame.id >> 8), frame.length};
  std::copy(frame.data.begin(), frame.data.end(), bytes.begin() + 3);
  return bytes;
}

[[nodiscard]] constexpr can::Frame lockstep_frame(const LockstepFrameBytes& bytes) noexcept {
  can::Frame frame;
  frame.id = static_cast<std::uint32_t>(bytes[0] | bytes[1] << 8);
  frame.length = bytes[2];
  std::copy(bytes.begin() + 3, bytes.end(), frame.data.begin());
  return frame;
}

}  // namespace cutforce::hal
