// Everything a controller may do, but that it may be off.
#pragma once

#include "control/permission.hpp"

namespace cutforce::host_tests {

[[nodiscard]] constexpr control::Permission enabled(bool enable) {
  auto permission = control::kEverything;
  permission.enable = enable;
  return permission;
}

}  // namespace cutforce::host_tests
