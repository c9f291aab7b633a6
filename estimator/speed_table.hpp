// A quantity over speed: straight lines through three support points, held beyond the ends.
// The sign of the speed does not matter. Values in any unit; speeds in rad/s.
#pragma once

#include <array>
#include <cstddef>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {

struct SpeedTable {
  std::array<float, 3> speed_rad_s;  // rising, the first not negative
  std::array<float, 3> value;

  [[nodiscard]] constexpr bool rising() const noexcept {
    return speed_rad_s[0] >= 0.0F && speed_rad_s[0] < speed_rad_s[1] &&
           speed_rad_s[1] < speed_rad_s[2] && speed_rad_s[2] < 1e6F;
  }
};

// The table as it is read: where a speed is in it, and what is there. Tables of the same speeds
// have their places in common.
class SpeedLines {
 public:
  struct Place {
    std::size_t line;  // that begins at this support point; behind the last one it is level
    float share;       // of it, 0..1
  };

  explicit constexpr SpeedLines(const SpeedTable& table) noexcept
      : speed_rad_s_(table.speed_rad_s),
        length_rad_s_{table.speed_rad_s[1] - table.speed_rad_s[0],
                      table.speed_rad_s[2] - table.speed_rad_s[1]},
        value_(table.value),
        rise_{table.value[1] - table.value[0], table.value[2] - table.value[1], 0.0F},
        level_(table.value[0] == table.value[1] && table.value[1] == table.value[2]) {}

  [[nodiscard]] constexpr Place place(float speed) const noexcept {
    const float w = magnitude(speed);
    if (!(w > speed_rad_s_[0])) return {.line = 0, .share = 0.0F};
    if (w >= speed_rad_s_[2]) return {.line = 2, .share = 0.0F};
    const std::size_t k = w < speed_rad_s_[1] ? 0 : 1;
    return {.line = k, .share = (w - speed_rad_s_[k]) / length_rad_s_[k]};
  }
  [[nodiscard]] constexpr float at(const Place& place) const noexcept {
    return value_[place.line] + place.share * rise_[place.line];
  }
  [[nodiscard]] constexpr float at(float speed) const noexcept {
    return level_ ? value_[0] : at(place(speed));
  }

  [[nodiscard]] constexpr bool has_places_of(const SpeedLines& other) const noexcept {
    return speed_rad_s_ == other.speed_rad_s_;
  }

 private:
  std::array<float, 3> speed_rad_s_;
  std::array<float, 2> length_rad_s_;
  std::array<float, 3> value_;
  std::array<float, 3> rise_;
  bool level_;  // the same everywhere, as a loss that is not known
};

}  // namespace cutforce::estimator
