// A CAN interface for a program that plays the board's other side (cutforce cnc): unlike
// SocketCan it leaves queueing to the kernel, for an acquisition node sends two or three frames at
// once and none of them is stale a millisecond later. On a bus without a receiver the kernel's
// queue fills, send() refuses, and what lies in it goes out when the bus is back: not for a board.
//
// It tells no bus errors but that the interface is down.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "hal/can_port.hpp"
#include "hal/linux/file_descriptor.hpp"
#include "hal/linux/open_error.hpp"

namespace cutforce::hal::os {

class PeerCan {
 public:
  // Fails iff the interface is missing, is not CAN or is down, or the kernel has no raw CAN.
  // `received`: 11-bit identifiers; nothing else is delivered, and no frame of this program.
  [[nodiscard]] static std::expected<PeerCan, OpenError> open(
      const std::string& interface, const std::vector<std::uint32_t>& received);

  [[nodiscard]] std::expected<std::size_t, PortError> receive(
      std::span<can::Frame> frames) noexcept;
  [[nodiscard]] std::expected<void, SendError> send(const can::Frame& frame) noexcept;
  [[nodiscard]] BusStatus status() const noexcept { return status_; }

 private:
  explicit PeerCan(FileDescriptor socket) noexcept : socket_(std::move(socket)) {}

  FileDescriptor socket_;
  BusStatus status_{.state = BusState::kActive,
                    .acknowledged = true,
                    .restarts = 0,
                    .unsent = 0,
                    .overrun = 0,
                    .error_frames = 0};
};
static_assert(CanPort<PeerCan>);

}  // namespace cutforce::hal::os
