// x^p for what the feed does to the force and back. A feed is known to a step of the override and a
// force to its noise, so 5e-6 is exact; it costs half of estimator/polynomials.hpp's seven digits.
//
//   x = 2^e m, m in [1/sqrt 2, sqrt 2):  log2 x = e + s (c_0 + c_1 s^2 + c_2 s^4), s = (m-1)/(m+1)
//   2^t = 2^n q(t - n), n the whole number next to t, q of the fourth order
//
// Minimax coefficients: |error of log2| <= 3e-8, relative error of 2^t <= 2.6e-6.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

namespace cutforce::control {

// x^p for normal positive x; relative error <= 5e-6 where |p log2 x| <= 50, bounded by 2^-125 and
// 2^125. x itself for p = 1.
[[nodiscard, gnu::noinline]] constexpr float feed_power(float x, float p) noexcept {
  if (p == 1.0F) return x;
  constexpr std::uint32_t kRootOfHalf = 0x3F3504F3;  // 1/sqrt 2
  constexpr float kRounder = 12582912.0F;            // 1.5 * 2^23, see polynomials.hpp
  const auto bits = std::bit_cast<std::uint32_t>(x);
  const std::int32_t e = static_cast<std::int32_t>(bits - kRootOfHalf) >> 23;
  const float m = std::bit_cast<float>(bits - (static_cast<std::uint32_t>(e) << 23U));
  const float s = (m - 1.0F) / (m + 1.0F);
  const float z = s * s;
  const float log2 =
      static_cast<float>(e) + s * (2.88539129F + z * (9.61470809e-1F + z * 5.98973886e-1F));
  const float t = std::clamp(p * log2, -125.0F, 125.0F);
  const float rounded = t + kRounder;
  const float r = t - (rounded - kRounder);
  const float q =
      (((9.57010191e-3F * r + 5.59178603e-2F) * r + 2.40247448e-1F) * r + 6.93121815e-1F) * r +
      9.99999261e-1F;
  return std::bit_cast<float>(std::bit_cast<std::uint32_t>(q) +
                              (std::bit_cast<std::uint32_t>(rounded) << 23U));
}

}  // namespace cutforce::control
