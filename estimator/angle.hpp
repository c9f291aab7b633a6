// The angle of a space vector without libm, so that every target gives the same bits: (E20).
//   angle(v) = atan2(v.beta, v.alpha) in (-pi, pi]
// Odd polynomial of degree 15 for atan on [0, 1], fitted for least largest relative error
// (1.0e-7), and the symmetry of the octants for the rest. Error of the whole in single precision:
// 4e-7 rad at most. The angle of the zero vector is 0.
#pragma once

#include <array>
#include <numbers>

#include "estimator/space_vector.hpp"

namespace cutforce::estimator {

// atan(x) for x in [0, 1].
[[nodiscard]] constexpr float arctangent(float x) noexcept {
  constexpr std::array<float, 8> kCoefficients{9.999999e-01F,   -3.333199e-01F, 1.9969723e-01F,
                                               -1.4019476e-01F, 9.9142775e-02F, -5.9486147e-02F,
                                               2.4252215e-02F,  -4.69322e-03F};
  const float square = x * x;
  float sum = kCoefficients[7];
  for (int k = 6; k >= 0; --k) sum = sum * square + kCoefficients[static_cast<std::size_t>(k)];
  return sum * x;
}

// Angle of the vector (alpha, beta), rad.
[[nodiscard]] constexpr float angle(SpaceVector v) noexcept {
  constexpr float kPi = std::numbers::pi_v<float>;
  const float x = v.alpha < 0.0F ? -v.alpha : v.alpha;
  const float y = v.beta < 0.0F ? -v.beta : v.beta;
  const float larger = x > y ? x : y;
  const float smaller = x > y ? y : x;
  if (!(larger > 0.0F)) return 0.0F;
  float result = arctangent(smaller / larger);
  if (y > x) result = 0.5F * kPi - result;
  if (v.alpha < 0.0F) result = kPi - result;
  return v.beta < 0.0F ? -result : result;
}

// Angle by which `to` is ahead of `from`, rad, in (-pi, pi].
[[nodiscard]] constexpr float angle_between(SpaceVector from, SpaceVector to) noexcept {
  return angle({.alpha = dot(to, from), .beta = cross(to, from)});
}

}  // namespace cutforce::estimator
