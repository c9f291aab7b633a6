#include "hal/linux/service_notifier.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <system_error>
#include <utility>

namespace cutforce::hal::os {
namespace {

constexpr std::size_t kLongestStatus = 200;
constexpr std::int64_t kMicrosecondNs = 1000;

template <class T>
T number_in(const char* variable) {
  const char* text = std::getenv(variable);
  T number = 0;
  if (text == nullptr) return 0;
  const auto* end = text + std::strlen(text);
  const auto [stop, error] = std::from_chars(text, end, number);
  return error == std::errc{} && stop == end ? number : 0;
}

// WATCHDOG_PID, where set, says whom WATCHDOG_USEC is for.
std::int64_t watchdog_period_ns() {
  const auto for_process = number_in<pid_t>("WATCHDOG_PID");
  if (for_process != 0 && for_process != ::getpid()) return 0;
  const auto period_us = number_in<std::int64_t>("WATCHDOG_USEC");
  return period_us > 0 && period_us < INT64_MAX / kMicrosecondNs ? period_us * kMicrosecondNs : 0;
}

}  // namespace

ServiceNotifier::ServiceNotifier(FileDescriptor socket, std::int64_t watchdog_ns) noexcept
    : socket_(std::move(socket)), watchdog_ns_(watchdog_ns) {}

auto ServiceNotifier::open() -> std::expected<ServiceNotifier, OpenError> {
  const char* path = std::getenv("NOTIFY_SOCKET");
  if (path == nullptr || *path == '\0') return ServiceNotifier{FileDescriptor{}, 0};
  const std::string_view name(path);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const auto refuse = [&](const std::string& why) {
    return std::unexpected{OpenError{"NOTIFY_SOCKET " + std::string(name), why,
                                     "start the service by its service manager, or unset it"}};
  };
  if ((name[0] != '/' && name[0] != '@') || name.size() >= sizeof address.sun_path) {
    return refuse("it is neither a path nor an abstract name, or too long");
  }
  std::copy(name.begin(), name.end(), address.sun_path);
  if (name[0] == '@') address.sun_path[0] = '\0';  // abstract: unix(7)
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
  FileDescriptor socket{::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)};
  if (!socket || ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), size) != 0) {
    return refuse(std::string("cannot be reached: ") + std::strerror(errno));
  }
  return ServiceNotifier{std::move(socket), watchdog_period_ns()};
}

auto ServiceNotifier::say(std::string_view message) const noexcept
    -> std::expected<void, PortError> {
  if (!socket_) return {};
  const auto size = ::send(socket_.get(), message.data(), message.size(), MSG_NOSIGNAL);
  if (size == static_cast<ssize_t>(message.size())) return {};
  return std::unexpected{PortError::kSystem};
}

auto ServiceNotifier::status(std::string_view text) const noexcept
    -> std::expected<void, PortError> {
  constexpr std::string_view kStart = "STATUS=";
  std::array<char, kStart.size() + kLongestStatus> message{};
  // A line end in the text would let it say READY=1.
  text = text.substr(0, std::min(text.find('\n'), kLongestStatus));
  auto* end = std::copy(kStart.begin(), kStart.end(), message.data());
  end = std::copy(text.begin(), text.end(), end);
  return say({message.data(), static_cast<std::size_t>(end - message.data())});
}

}  // namespace cutforce::hal::os
