// A CAN network interface, by name: is it there, is it CAN, is it up; and taking it down and up.
// For opening and for the housekeeping thread: allocates.
#pragma once

#include <expected>
#include <string>

#include "hal/linux/open_error.hpp"

namespace cutforce::hal::os {

struct CanInterface {
  int index;
  bool echoes_when_sent;  // IFF_ECHO: an own frame is heard back when it has left the controller
};

// Fails iff there is no such interface, it is not CAN, or it is down.
[[nodiscard]] std::expected<CanInterface, OpenError> find_can_interface(const std::string& name);

// Down and up again: the controller starts anew and what waited to be sent is gone. Unlike a
// netlink restart it works for every driver, slcan among them. Needs CAP_NET_ADMIN.
[[nodiscard]] std::expected<void, OpenError> take_down(const std::string& name);
[[nodiscard]] std::expected<void, OpenError> take_up(const std::string& name);

}  // namespace cutforce::hal::os
