// x^p for what the feed does to the force and back. A feed is known to a step of the override and a
// force to its noise, so 5e-6 is exact; it costs half of estimator/polynomials.hpp's seven digits.
//
//   x = 2^e m, m in [1/sqrt 2, sqrt 2):  log2 x = e + s (c_0 + c_1 s^2 + c_2 s^4), s = (m-1)/(m+1)
//   2^t = 2^n q(t - n), n the whole number next to t, q of the fourth order
//
// Minimax coefficients: |error of log2| <= 3e-8, relative error of 2^t <= 2.6e-6.
#pragma once

namespace cutforce::control {

// x^p for normal positive x; relative error <= 5e-6 where |p log2 x| <= 50, bounded by 2^-125 and
// 2^125. x itself for p = 1.
[[nodiscard]] float feed_power(float x, float p) noexcept;

}  // namespace cutforce::control
