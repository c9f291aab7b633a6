// The CAN controller through SocketCAN, as hal::CanPort has it.
//
// The kernel filters by identifier, so a flood of other frames costs the control thread nothing.
// A frame is sent only if the one before has left (can_send_gate.hpp); the service sends one frame
// a tick and the next when this one was heard back in receive(). Error frames change status() and
// never reach the caller.
//
// Frame::own: sent by this very port. A frame from another program on the same machine is foreign:
// a second service with our identifiers must be noticed.
//
// Threads: receive, send and status belong to the control thread and neither allocate nor wait.
// restart() belongs to another one and may take seconds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "hal/can_port.hpp"
#include "hal/linux/open_error.hpp"

namespace cutforce::hal::os {

class SocketCan {
 public:
  struct Config {
    std::string interface;                // "can0"
    std::vector<std::uint32_t> received;  // 11-bit identifiers; nothing else is delivered
    std::vector<std::uint32_t> sent;      // own ones: heard back, and noticed from elsewhere
  };

  // Fails iff the interface is missing, is not CAN or is down, or the kernel has no raw CAN.
  [[nodiscard]] static std::expected<SocketCan, OpenError> open(const Config& config);

  SocketCan(SocketCan&&) noexcept;
  SocketCan& operator=(SocketCan&&) noexcept;
  ~SocketCan();

  // Reads no more than a bounded number of messages, error frames among them, so a babbling bus
  // cannot hold the tick.
  [[nodiscard]] std::expected<std::size_t, PortError> receive(
      std::span<can::Frame> frames) noexcept;
  [[nodiscard]] std::expected<void, SendError> send(const can::Frame& frame) noexcept;
  [[nodiscard]] BusStatus status() noexcept;

  // Takes the interface down and up. What waited to be sent is gone. After it fails, the state is
  // kDown or kOff still; restart_delay.hpp says when to try again.
  [[nodiscard]] std::expected<void, OpenError> restart();

 private:
  struct Impl;
  explicit SocketCan(std::unique_ptr<Impl> impl) noexcept;

  std::unique_ptr<Impl> impl_;
};
static_assert(CanPort<SocketCan>);

}  // namespace cutforce::hal::os
