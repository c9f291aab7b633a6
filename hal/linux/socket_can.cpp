#include "hal/linux/socket_can.hpp"

#include <linux/can.h>
#include <linux/can/raw.h>
#include <linux/sock_diag.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>

#include "hal/linux/can_bus_monitor.hpp"
#include "hal/linux/can_interface.hpp"
#include "hal/linux/can_send_gate.hpp"
#include "hal/linux/file_descriptor.hpp"
#include "hal/linux/monotonic_clock.hpp"

namespace cutforce::hal::os {
namespace {

constexpr std::size_t kErrorFramesAtOnce = 32;  // read beside the caller's frames
constexpr int kSmallestSendBuffer = 1;          // the kernel makes its own minimum of it

template <class T>
bool set_option(int socket, int level, int option, const T& value) {
  return ::setsockopt(socket, level, option, &value, sizeof value) == 0;
}

bool is_gone(int error) {
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

can_frame to_kernel(const can::Frame& frame) noexcept {
  can_frame raw{};
  raw.can_id = frame.id & (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  if (frame.extended) raw.can_id |= CAN_EFF_FLAG;
  if (frame.remote) raw.can_id |= CAN_RTR_FLAG;
  raw.len = std::min<std::uint8_t>(frame.length, CAN_MAX_DLEN);
  std::copy_n(frame.data.begin(), raw.len, raw.data);
  return raw;
}

std::vector<can_filter> filters_of(const SocketCan::Config& config) {
  std::vector<can_filter> filters;
  for (const auto* list : {&config.received, &config.sent}) {
    for (const auto id : *list) {
      // The flags in the mask: an extended or remote frame with the same number does not pass.
      filters.push_back({id, CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_SFF_MASK});
    }
  }
  return filters;
}

}  // namespace

struct SocketCan::Impl {
  Config config;
  std::vector<can_filter> filters;
  FileDescriptor socket;
  int index;
  CanBusMonitor monitor;
  CanSendGate gate{};
  std::uint32_t unsent = 0;
  std::uint32_t dropped = 0;  // the socket's own count, since it was opened
  std::uint32_t restarts_seen = 0;
  // The only members that both threads touch.
  std::atomic<std::uint32_t> restarts{0};
  std::atomic<bool> restarting{false};

  Impl(const Config& wanted, FileDescriptor opened, const CanInterface& interface)
      : config(wanted),
        filters(filters_of(wanted)),
        socket(std::move(opened)),
        index(interface.index),
        monitor(interface.echoes_when_sent) {}

  bool bind_to_interface() const {
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = index;
    const auto bytes = static_cast<socklen_t>(filters.size() * sizeof(can_filter));
    return ::setsockopt(socket.get(), SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), bytes) == 0 &&
           ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }

  bool set_options() const {
    const can_err_mask_t errors = subscribed_error_classes();
    const int on = 1;
    return set_option(socket.get(), SOL_CAN_RAW, CAN_RAW_ERR_FILTER, errors) &&
           set_option(socket.get(), SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, on) &&
           set_option(socket.get(), SOL_SOCKET, SO_RXQ_OVFL, on) &&
           set_option(socket.get(), SOL_SOCKET, SO_SNDBUF, kSmallestSendBuffer);
  }

  void notice_restart() noexcept {
    const auto count = restarts.load(std::memory_order_acquire);
    if (count == restarts_seen) return;
    restarts_seen = count;
    monitor.restarted();
    gate.forget();
  }

  void lose_link() noexcept {
    monitor.down();
    gate.forget();
  }

  // What waits between this socket and the driver.
  bool queue_empty() const noexcept {
    std::array<std::uint32_t, SK_MEMINFO_VARS> memory{};
    socklen_t size = sizeof memory;
    if (::getsockopt(socket.get(), SOL_SOCKET, SO_MEMINFO, memory.data(), &size) != 0) return true;
    return memory[SK_MEMINFO_WMEM_ALLOC] == 0;
  }

  void count_dropped(msghdr& message) noexcept {
    for (auto* part = CMSG_FIRSTHDR(&message); part != nullptr;
         part = CMSG_NXTHDR(&message, part)) {
      if (part->cmsg_level == SOL_SOCKET && part->cmsg_type == SO_RXQ_OVFL) {
        std::memcpy(&dropped, CMSG_DATA(part), sizeof dropped);
      }
    }
  }

  // Returns whether `frame` is one for the caller.
  bool take(const can_frame& raw, int flags, can::Frame& frame) noexcept {
    const auto now_ns = monotonic_ns();
    if ((raw.can_id & CAN_ERR_FLAG) != 0) {
      std::array<std::uint8_t, 8> data{};
      std::copy_n(raw.data, data.size(), data.begin());
      const auto news = read_error_frame(raw.can_id & CAN_ERR_MASK, data);
      monitor.error_frame(news, now_ns);
      if (news.disturbed) gate.trouble();
      if (!monitor.usable()) gate.forget();
      return false;
    }
    frame = from_kernel(raw);
    frame.own = (flags & MSG_CONFIRM) != 0;
    if (!frame.own) {
      monitor.foreign_frame(now_ns);
    } else if (gate.heard_back(frame)) {
      monitor.heard_back(now_ns);
    }
    return true;
  }
};

SocketCan::SocketCan(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
SocketCan::SocketCan(SocketCan&&) noexcept = default;
SocketCan& SocketCan::operator=(SocketCan&&) noexcept = default;
SocketCan::~SocketCan() = default;

auto SocketCan::open(const Config& config) -> std::expected<SocketCan, OpenError> {
  const std::string where = "CAN interface " + config.interface;
  FileDescriptor socket{::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW)};
  if (!socket) {
    return std::unexpected{
        OpenError{where, std::string("no raw CAN socket: ") + std::strerror(errno),
                  "run `modprobe can-raw`, or take a kernel with CONFIG_CAN_RAW"}};
  }
  const auto interface = find_can_interface(config.interface);
  if (!interface) return std::unexpected{interface.error()};
  auto impl = std::make_unique<Impl>(config, std::move(socket), *interface);
  if (!impl->set_options() || !impl->bind_to_interface()) {
    return std::unexpected{OpenError{where, std::string("refused: ") + std::strerror(errno),
                                     "take Linux 4.12 or later and look at the kernel's log"}};
  }
  return SocketCan{std::move(impl)};
}

auto SocketCan::receive(std::span<can::Frame> frames) noexcept
    -> std::expected<std::size_t, PortError> {
  auto& port = *impl_;
  port.notice_restart();
  std::size_t count = 0;
  for (auto left = frames.size() + kErrorFramesAtOnce; left > 0 && count < frames.size(); --left) {
    can_frame raw{};
    iovec bytes{&raw, sizeof raw};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(std::uint32_t))> control{};
    msghdr message{};
    message.msg_iov = &bytes;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const auto size = ::recvmsg(port.socket.get(), &message, MSG_DONTWAIT);
    if (size < 0) {
      if (errno == EINTR) continue;
      if (errno == EAGAIN) break;
      if (!is_gone(errno)) return std::unexpected{PortError::kSystem};
      port.lose_link();
      continue;  // the error is told once; frames from before may follow
    }
    port.count_dropped(message);
    if (size != sizeof raw) continue;  // not a classic frame
    if (port.take(raw, message.msg_flags, frames[count])) ++count;
  }
  return count;
}

auto SocketCan::send(const can::Frame& frame) noexcept -> std::expected<void, SendError> {
  auto& port = *impl_;
  port.notice_restart();
  if (!port.monitor.usable() || port.restarting.load(std::memory_order_acquire)) {
    return std::unexpected{SendError::kDown};
  }
  const auto now_ns = monotonic_ns();
  if (!port.gate.open(now_ns, port.queue_empty())) {
    if (port.gate.unacknowledged(now_ns)) port.monitor.unacknowledged();
    ++port.unsent;
    return std::unexpected{SendError::kNoRoom};
  }
  const auto raw = to_kernel(frame);
  if (::send(port.socket.get(), &raw, sizeof raw, MSG_DONTWAIT) == sizeof raw) {
    port.gate.sent(frame, now_ns);
    return {};
  }
  if (errno == EAGAIN || errno == ENOBUFS || errno == EINTR) {
    ++port.unsent;
    return std::unexpected{SendError::kNoRoom};
  }
  if (!is_gone(errno)) return std::unexpected{SendError::kSystem};
  port.lose_link();
  return std::unexpected{SendError::kDown};
}

auto SocketCan::status() noexcept -> BusStatus {
  auto& port = *impl_;
  port.notice_restart();
  return {.state = port.monitor.state(),
          .acknowledged = port.monitor.acknowledged(),
          .restarts = port.restarts_seen,
          .unsent = port.unsent,
          .overrun = port.dropped + port.monitor.controller_overruns(),
          .error_frames = port.monitor.error_frames()};
}

auto SocketCan::restart() -> std::expected<void, OpenError> {
  auto& port = *impl_;
  const struct Busy {
    std::atomic<bool>& flag;
    explicit Busy(std::atomic<bool>& which) : flag(which) { flag.store(true); }
    ~Busy() { flag.store(false); }
  } busy(port.restarting);
  if (const auto down = take_down(port.config.interface); !down) return down;
  // Our own taking down leaves ENETDOWN on the socket; read here, or it would look like a new one.
  int ours = 0;
  socklen_t size = sizeof ours;
  ::getsockopt(port.socket.get(), SOL_SOCKET, SO_ERROR, &ours, &size);
  if (const auto up = take_up(port.config.interface); !up) return up;
  const auto interface = find_can_interface(port.config.interface);
  if (!interface) return std::unexpected{interface.error()};
  // An adapter that was pulled out and in again has another index, and the socket lost its filters.
  port.index = interface->index;
  if (!port.bind_to_interface()) {
    return std::unexpected{OpenError{"CAN interface " + port.config.interface,
                                     std::string("cannot be bound again: ") + std::strerror(errno),
                                     "restart the service"}};
  }
  port.restarts.fetch_add(1, std::memory_order_release);
  return {};
}

}  // namespace cutforce::hal::os
