// Elementary functions by arithmetic alone, so that every target gives the same bits: glibc,
// newlib and picolibc differ in the last place, and a Cortex-M4F pays for a library call.
// Coefficients of atan, exp, log: S. L. Moshier, Cephes single precision library (public domain).
// Error bounds are measured over all floats of the stated range by polynomials_test.cpp.
#pragma once

#include <bit>
#include <cstdint>

namespace cutforce::estimator {

[[nodiscard]] constexpr float magnitude(float x) noexcept { return __builtin_fabsf(x); }

// |error| <= 1.2e-7 rad for |x| <= tan(pi/8); (E50).
[[nodiscard]] constexpr float atan_small(float x) noexcept {
  const float z = x * x;
  return (((8.05374449538e-2F * z - 1.38776856032e-1F) * z + 1.99777106478e-1F) * z -
          3.33329491539e-1F) *
             z * x +
         x;
}

// Angle of (x, y) in (-pi, pi]; 0 for the null vector. |error| <= 4e-7 rad.
[[nodiscard]] constexpr float angle_of(float x, float y) noexcept {
  constexpr float kPi = 3.14159265358979F;
  constexpr float kFold = 0.414213562F;  // tan(pi/8)
  // Vectors that follow one another are seldom further apart; the same bits with a third of the
  // way.
  const float ax = magnitude(x);
  const float ay = magnitude(y);
  if (x > 0.0F && ay <= kFold * x) [[likely]]
    return atan_small(y / x);
  const float high = ax > ay ? ax : ay;
  const float low = ax > ay ? ay : ax;
  if (!(high > 0.0F)) return 0.0F;
  const bool folded = low > kFold * high;
  const float ratio = folded ? (low - high) / (low + high) : low / high;
  float angle = atan_small(ratio) + (folded ? 0.25F * kPi : 0.0F);
  if (ay > ax) angle = 0.5F * kPi - angle;
  if (x < 0.0F) angle = kPi - angle;
  return y < 0.0F ? -angle : angle;
}

// tan(x)/x by the [4/4] Pade approximant; relative error <= 3e-7 for |x| <= 1; (E51).
[[nodiscard]] constexpr float tan_over_x(float x) noexcept {
  const float z = x * x;
  return (945.0F + z * (z - 105.0F)) / (945.0F + z * (15.0F * z - 420.0F));
}

// sin and cos by Taylor polynomials; |error| <= 2e-7 for |x| <= 0.8; (E52).
[[nodiscard]] constexpr float sin_small(float x) noexcept {
  const float z = x * x;
  return x + x * z * (-1.6666667e-1F + z * (8.3333310e-3F + z * (-1.9840874e-4F + z * 2.7e-6F)));
}
[[nodiscard]] constexpr float cos_small(float x) noexcept {
  const float z = x * x;
  return 1.0F + z * (-0.5F + z * (4.16666642e-2F + z * (-1.38888e-3F + z * 2.46e-5F)));
}

struct CosineSine {
  float cosine;
  float sine;
};

// Taylor at a quarter of the angle, doubled twice. Within |x| <= pi the remainders, x^10/10! and
// x^11/11! at pi/4, are below 3e-8; rounding of the doublings dominates.
[[nodiscard]] constexpr CosineSine cosine_sine(float angle_rad) noexcept {
  const float x = 0.25F * angle_rad;
  const float q = x * x;
  float s = x * (1.0F + q * (-1.0F / 6.0F +
                             q * (1.0F / 120.0F + q * (-1.0F / 5040.0F + q * (1.0F / 362880.0F)))));
  float c = 1.0F + q * (-0.5F + q * (1.0F / 24.0F + q * (-1.0F / 720.0F + q * (1.0F / 40320.0F))));
  for (int doubling = 0; doubling < 2; ++doubling) {
    const float doubled = 2.0F * s * c;
    c = 1.0F - 2.0F * s * s;
    s = doubled;
  }
  return {c, s};
}

// exp(x); relative error <= 2e-7 for |x| <= 87, clamped outside; (E53).
[[nodiscard]] constexpr float exp_bounded(float x) noexcept {
  if (!(magnitude(x) <= 87.0F)) x = x > 0.0F ? 87.0F : -87.0F;
  // 1.5 * 2^23: a sum with it has no digits behind the point, and the whole number in its last
  // bits.
  constexpr float kRounder = 12582912.0F;
  const float rounded = x * 1.44269504F + kRounder;
  const float n = rounded - kRounder;
  const float r = (x - n * 0.693359375F) + n * 2.12194440e-4F;
  const float poly =
      ((((1.9875691500e-4F * r + 1.3981999507e-3F) * r + 8.3334519073e-3F) * r + 4.1665795894e-2F) *
           r +
       1.6666665459e-1F) *
          r +
      5.0000001201e-1F;
  const float mantissa = poly * r * r + r + 1.0F;
  const auto exponent = (std::bit_cast<std::uint32_t>(rounded) + 127U) << 23U;
  return mantissa * std::bit_cast<float>(exponent);
}

// 2^x for |x| <= 120, to 8e-5 of itself: for weights and probabilities; (E55).
[[nodiscard]] constexpr float exp2_coarse(float x) noexcept {
  constexpr float kRounder = 12582912.0F;
  const float rounded = x + kRounder;
  const float f = x - (rounded - kRounder);
  const float mantissa =
      ((5.51716691e-2F * f + 2.42611122e-1F) * f + 6.93260985e-1F) * f + 9.99928074e-1F;
  const auto exponent = std::bit_cast<std::uint32_t>(rounded) << 23U;
  return std::bit_cast<float>(std::bit_cast<std::uint32_t>(mantissa) + exponent);
}

// ln(x) for normal positive x; relative error <= 3e-7; (E54).
[[nodiscard]] constexpr float log_positive(float x) noexcept {
  const auto bits = std::bit_cast<std::uint32_t>(x);
  int exponent = static_cast<int>(bits >> 23U) - 126;
  float m = std::bit_cast<float>((bits & 0x007FFFFFU) | 0x3F000000U);  // in [0.5, 1)
  if (m < 0.707106781F) {
    --exponent;
    m = m + m;
  }
  const float r = m - 1.0F;
  const float z = r * r;
  float poly = 7.0376836292e-2F;
  poly = poly * r - 1.1514610310e-1F;
  poly = poly * r + 1.1676998740e-1F;
  poly = poly * r - 1.2420140846e-1F;
  poly = poly * r + 1.4249322787e-1F;
  poly = poly * r - 1.6668057665e-1F;
  poly = poly * r + 2.0000714765e-1F;
  poly = poly * r - 2.4999993993e-1F;
  poly = poly * r + 3.3333331174e-1F;
  const float n = static_cast<float>(exponent);
  return r + (poly * r * z - 2.12194440e-4F * n - 0.5F * z) + 0.693359375F * n;
}

// x^p for normal positive x and |p ln x| <= 87; relative error <= 2e-7 + 4e-7 |p ln x|. Not
// inlined: it is 300 bytes of code, and its dozen callers save 3 instructions of 70.
[[nodiscard]] [[gnu::noinline]] constexpr float power_positive(float x, float p) noexcept {
  return p == 1.0F ? x : exp_bounded(p * log_positive(x));
}

}  // namespace cutforce::estimator
