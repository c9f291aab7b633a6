// The contract between the board and its CAN controller. Nothing here waits, and nothing queues:
// what could not be sent at once is forgotten by whoever sent it, for a newer frame will follow.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>

#include "hal/can/frame.hpp"
#include "hal/port.hpp"

namespace cutforce::hal {

// As the controller says it. From kOff and kDown nothing comes back by itself: whoever opened the
// port restarts it, and whatever waited to be sent before is gone then.
enum class BusState : std::uint8_t { kActive, kWarning, kPassive, kOff, kDown };

struct BusStatus {
  BusState state;
  bool acknowledged;           // false: the last frames had no receiver
  std::uint32_t restarts;      // since the port was opened
  std::uint32_t unsent;        // frames that the controller had no room for
  std::uint32_t overrun;       // received frames that were lost before they were read
  std::uint32_t error_frames;  // of any kind
};

enum class SendError : std::uint8_t {
  kNoRoom,  // an older frame still waits: on a bus without another node for ever
  kDown,    // bus-off, or the interface is down
  kSystem,
};

// receive() fills the front of `frames` with what has come and returns how many; 0: nothing waits.
// It fails iff the operating system refuses. send() hands over one frame, or refuses it.
template <class P>
concept CanPort = requires(P& port, std::span<can::Frame> frames, const can::Frame& frame) {
  { port.receive(frames) } -> std::same_as<std::expected<std::size_t, PortError>>;
  { port.send(frame) } -> std::same_as<std::expected<void, SendError>>;
  { port.status() } -> std::same_as<BusStatus>;
};

}  // namespace cutforce::hal
