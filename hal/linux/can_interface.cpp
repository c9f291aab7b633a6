#include "hal/linux/can_interface.hpp"

#include <linux/can.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "hal/linux/file_descriptor.hpp"

namespace cutforce::hal::os {
namespace {

// linux/if_arp.h and net/if.h cannot be included together.
constexpr unsigned short kHardwareCan = 280;     // ARPHRD_CAN
constexpr unsigned long kEchoFlag = 1UL << 18U;  // IFF_ECHO; net/if.h has it not

std::unexpected<OpenError> refuse(const std::string& name, std::string what, std::string remedy) {
  return std::unexpected{OpenError{"CAN interface " + name, std::move(what), std::move(remedy)}};
}

// Any datagram socket takes the requests about interfaces; a CAN one may not exist here.
FileDescriptor control_socket() {
  return FileDescriptor{::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
}

bool fill_name(ifreq& request, const std::string& name) {
  if (name.empty() || name.size() >= sizeof request.ifr_name) return false;
  std::memcpy(request.ifr_name, name.c_str(), name.size() + 1);
  return true;
}

bool is_can(int socket, const std::string& name) {
  ifreq request{};
  return fill_name(request, name) && ::ioctl(socket, SIOCGIFHWADDR, &request) == 0 &&
         request.ifr_hwaddr.sa_family == kHardwareCan;
}

std::string list_of_can_interfaces(int socket) {
  std::string list;
  if (auto* all = if_nameindex(); all != nullptr) {
    for (auto* one = all; one->if_name != nullptr; ++one) {
      if (is_can(socket, one->if_name))
        list += (list.empty() ? "" : ", ") + std::string(one->if_name);
    }
    if_freenameindex(all);
  }
  return list;
}

// SIOCGIFFLAGS has 16 bits only, and the echo is bit 18.
bool echoes_when_sent(const std::string& name) {
  std::ifstream file("/sys/class/net/" + name + "/flags");
  unsigned long flags = 0;
  return (file >> std::hex >> flags) && (flags & kEchoFlag) != 0;
}

std::expected<void, OpenError> set_up(const std::string& name, bool up) {
  const auto socket = control_socket();
  ifreq request{};
  if (!fill_name(request, name) || ::ioctl(socket.get(), SIOCGIFFLAGS, &request) != 0) {
    return refuse(name, "has gone", "plug the adapter in again");
  }
  const int flags = up ? request.ifr_flags | IFF_UP : request.ifr_flags & ~IFF_UP;
  request.ifr_flags = static_cast<short>(flags);
  if (::ioctl(socket.get(), SIOCSIFFLAGS, &request) == 0) return {};
  const int error = errno;
  const std::string what =
      std::string("cannot be taken ") + (up ? "up: " : "down: ") + std::strerror(error);
  if (error == EPERM) {
    return refuse(name, what, "give the service CAP_NET_ADMIN (systemd: AmbientCapabilities=)");
  }
  return refuse(name, what, "look at `ip -details link show " + name + "` and the kernel's log");
}

}  // namespace

auto find_can_interface(const std::string& name) -> std::expected<CanInterface, OpenError> {
  const auto socket = control_socket();
  ifreq request{};
  if (!fill_name(request, name) || ::ioctl(socket.get(), SIOCGIFINDEX, &request) != 0) {
    const auto list = list_of_can_interfaces(socket.get());
    return refuse(name, "there is no such interface",
                  list.empty() ? "this machine has no CAN interface: load its driver"
                               : "name one of: " + list);
  }
  const int index = request.ifr_ifindex;
  if (!is_can(socket.get(), name)) {
    const auto list = list_of_can_interfaces(socket.get());
    return refuse(name, "it is not a CAN interface",
                  list.empty() ? "load the driver of the CAN controller" : "name one of: " + list);
  }
  if (::ioctl(socket.get(), SIOCGIFFLAGS, &request) != 0) {
    return refuse(name, std::strerror(errno), "try again");
  }
  if ((request.ifr_flags & IFF_UP) == 0) {
    return refuse(name, "it is down",
                  "run `ip link set " + name + " up type can bitrate 500000 restart-ms 0`");
  }
  return CanInterface{.index = index, .echoes_when_sent = echoes_when_sent(name)};
}

auto take_down(const std::string& name) -> std::expected<void, OpenError> {
  return set_up(name, false);
}

auto take_up(const std::string& name) -> std::expected<void, OpenError> {
  return set_up(name, true);
}

}  // namespace cutforce::hal::os
