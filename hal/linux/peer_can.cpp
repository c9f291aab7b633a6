#include "hal/linux/peer_can.hpp"

#include <linux/can.h>
#include <linux/can/raw.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "hal/linux/can_interface.hpp"

namespace cutforce::hal::os {
namespace {

bool is_down(int error) {
  return error == ENETDOWN || error == ENODEV || error == ENXIO || error == ENETUNREACH;
}

can::Frame from_kernel(const can_frame& raw) noexcept {
  can::Frame frame;
  frame.extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.remote = (raw.can_id & CAN_RTR_FLAG) != 0;
  frame.id = raw.can_id & (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.length = std::min<std::uint8_t>(raw.len, CAN_MAX_DLEN);
  std::copy_n(raw.data, frame.length, frame.data.begin());
  return frame;
}

bool bind_to(const FileDescriptor& socket, int index, const std::vector<std::uint32_t>& received) {
  std::vector<can_filter> filters;
  for (const auto id : received) {
    filters.push_back({id, CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_SFF_MASK});
  }
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = index;
  const auto bytes = static_cast<socklen_t>(filters.size() * sizeof(can_filter));
  return ::setsockopt(socket.get(), SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), bytes) == 0 &&
         ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

}  // namespace

auto PeerCan::open(const std::string& interface, const std::vector<std::uint32_t>& received)
    -> std::expected<PeerCan, OpenError> {
  const std::string where = "CAN interface " + interface;
  FileDescriptor socket{::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW)};
  if (!socket) {
    return std::unexpected{
        OpenError{where, std::string("no raw CAN socket: ") + std::strerror(errno),
                  "run `modprobe can-raw`, or take a kernel with CONFIG_CAN_RAW"}};
  }
  const auto found = find_can_interface(interface);
  if (!found) return std::unexpected{found.error()};
  if (!bind_to(socket, found->index, received)) {
    return std::unexpected{OpenError{where, std::string("refused: ") + std::strerror(errno),
                                     "take Linux 4.12 or later and look at the kernel's log"}};
  }
  return PeerCan{std::move(socket)};
}

auto PeerCan::receive(std::span<can::Frame> frames) noexcept
    -> std::expected<std::size_t, PortError> {
  std::size_t count = 0;
  while (count < frames.size()) {
    can_frame raw{};
    const auto size = ::recv(socket_.get(), &raw, sizeof raw, MSG_DONTWAIT);
    if (size == static_cast<ssize_t>(sizeof raw)) {
      frames[count++] = from_kernel(raw);
    } else if (size < 0 && is_down(errno)) {
      status_.state = BusState::kDown;  // told once; it may come up again
    } else if (size < 0 && errno == EAGAIN) {
      break;
    } else if (size < 0 && errno != EINTR) {
      return std::unexpected{PortError::kSystem};
    }
  }
  return count;
}

auto PeerCan::send(const can::Frame& frame) noexcept -> std::expected<void, SendError> {
  can_frame raw{};
  raw.can_id = frame.id & CAN_SFF_MASK;
  raw.len = std::min<std::uint8_t>(frame.length, CAN_MAX_DLEN);
  std::copy_n(frame.data.begin(), raw.len, raw.data);
  const auto sent = ::send(socket_.get(), &raw, sizeof raw, MSG_DONTWAIT);
  if (sent == static_cast<ssize_t>(sizeof raw)) {
    status_.state = BusState::kActive;
    return {};
  }
  ++status_.unsent;
  if (is_down(errno)) {
    status_.state = BusState::kDown;
    return std::unexpected{SendError::kDown};
  }
  const bool full = errno == ENOBUFS || errno == EAGAIN;
  return std::unexpected{full ? SendError::kNoRoom : SendError::kSystem};
}

}  // namespace cutforce::hal::os
