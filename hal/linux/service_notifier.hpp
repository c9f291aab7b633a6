// The service manager's ear: systemd's notification protocol, sd_notify(3). One datagram of
// VAR=value lines to the socket that NOTIFY_SOCKET names. By hand, because libsystemd is a shared
// library only and would come into a static image for this one call.
//
// Without a service manager every call does nothing and succeeds. No call but open() allocates.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <string_view>

#include "hal/linux/file_descriptor.hpp"
#include "hal/linux/open_error.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::os {

class ServiceNotifier {
 public:
  // Reads NOTIFY_SOCKET and WATCHDOG_USEC. Fails iff the first names no socket that can be reached.
  [[nodiscard]] static std::expected<ServiceNotifier, OpenError> open();

  [[nodiscard]] bool is_listened_to() const noexcept { return static_cast<bool>(socket_); }
  // How often alive() must be called, at least twice within it; 0: nobody watches.
  [[nodiscard]] std::int64_t watchdog_ns() const noexcept { return watchdog_ns_; }

  // kSystem also where the manager's queue is full: it is told again at the next call.
  [[nodiscard]] std::expected<void, PortError> ready() const noexcept { return say("READY=1"); }
  [[nodiscard]] std::expected<void, PortError> alive() const noexcept { return say("WATCHDOG=1"); }
  [[nodiscard]] std::expected<void, PortError> stopping() const noexcept {
    return say("STOPPING=1");
  }
  // One line, at most 200 bytes; what is beyond, or after a line end, is left out.
  [[nodiscard]] std::expected<void, PortError> status(std::string_view text) const noexcept;

 private:
  ServiceNotifier(FileDescriptor socket, std::int64_t watchdog_ns) noexcept;
  [[nodiscard]] std::expected<void, PortError> say(std::string_view message) const noexcept;

  FileDescriptor socket_;
  std::int64_t watchdog_ns_;
};

}  // namespace cutforce::hal::os
