// A quantity over speed: straight lines through three support points, held beyond the ends.
// The sign of the speed does not matter. Values in any unit; speeds in rad/s.
#pragma once

#include <array>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {

struct SpeedTable {
  std::array<float, 3> speed_rad_s;  // rising, the first not negative
  std::array<float, 3> value;

  [[nodiscard]] constexpr bool rising() const noexcept {
    return speed_rad_s[0] >= 0.0F && speed_rad_s[0] < speed_rad_s[1] &&
           speed_rad_s[1] < speed_rad_s[2] && speed_rad_s[2] < 1e6F;
  }

  [[nodiscard]] constexpr float at(float speed) const noexcept {
    const float w = magnitude(speed);
    if (!(w > speed_rad_s[0])) return value[0];
    if (w >= speed_rad_s[2]) return value[2];
    const std::size_t k = w < speed_rad_s[1] ? 0 : 1;
    const float share = (w - speed_rad_s[k]) / (speed_rad_s[k + 1] - speed_rad_s[k]);
    return value[k] + share * (value[k + 1] - value[k]);
  }
};

}  // namespace cutforce::estimator
