// What the controller may do, as the supervisor and the CNC's job say it.
#pragma once

#include <type_traits>

namespace cutforce::control {

struct Permission {
  bool enable;              // false: the override goes to its neutral value
  bool may_rise;            // false: frozen or falling
  float ceiling_pct;        // beside the configured one; 254 where nobody objects
  float floor_pct;          // likewise; 0
  float force_reference_n;  // 0: the configured one
};
inline constexpr Permission kEverything{.enable = true,
                                        .may_rise = true,
                                        .ceiling_pct = 254.0F,
                                        .floor_pct = 0.0F,
                                        .force_reference_n = 0.0F};
static_assert(std::is_trivially_copyable_v<Permission>);

}  // namespace cutforce::control
