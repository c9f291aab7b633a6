// How fast the spindle turns, as a part of what the program asks for. A feed per turn follows the
// spindle, so a law that knows the ratio need not find it out from the force.
#pragma once

#include <algorithm>

namespace cutforce::firmware {

// 1 where nothing can be told: no programmed speed, a spindle that stands, values that are not
// finite. Either sense of rotation is the programmed one. Within 0.1..10: no spindle is asked for
// more, and what lies beyond is a mistake of the programmed speed or a run-up.
[[nodiscard]] constexpr float spindle_ratio(float speed_rad_s, float programmed_rad_s) noexcept {
  constexpr float kLeast = 0.1F;
  constexpr float kMost = 10.0F;
  constexpr float kLargest = 1e9F;
  const float magnitude_rad_s = speed_rad_s < 0.0F ? -speed_rad_s : speed_rad_s;
  const bool known = programmed_rad_s > 0.0F && programmed_rad_s < kLargest &&
                     magnitude_rad_s > 0.0F && magnitude_rad_s < kLargest;
  return known ? std::clamp(magnitude_rad_s / programmed_rad_s, kLeast, kMost) : 1.0F;
}

}  // namespace cutforce::firmware
