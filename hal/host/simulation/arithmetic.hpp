// Elementary functions by IEEE arithmetic alone, so that one seed gives the same bits on every
// machine: the library's differ between versions and between processors with and without FMA.
// Only sqrt, floor and ldexp are taken from it; IEEE 754 leaves them no freedom.
#pragma once

namespace cutforce::hal::host {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kTwoPi = 2.0 * kPi;

struct SineCosine {
  double sine;
  double cosine;
};

// Absolute error <= 2e-16 + 1e-16 |x|, |x| < 1e9.
[[nodiscard]] SineCosine sine_cosine(double x_rad) noexcept;
// Relative error <= 5e-16 for |x| < 700; 0 below, infinity above.
[[nodiscard]] double exponential(double x) noexcept;
// Natural logarithm of a normal x > 0, absolute error <= 5e-16 (1 + |ln x|).
[[nodiscard]] double logarithm(double x) noexcept;
// x^y for x >= 0; 0^y is 0.
[[nodiscard]] double power(double x, double y) noexcept;
// Exactly +-1 beyond +-20.
[[nodiscard]] inline double hyperbolic_tangent(double x) noexcept {
  if (x > 20.0) return 1.0;
  if (x < -20.0) return -1.0;
  const double e = exponential(2.0 * x);
  return (e - 1.0) / (e + 1.0);
}
// 1 - exp(-step/time): share of the way that a first-order lag goes in one step; 1 for time 0.
[[nodiscard]] double lag_share(double step_s, double time_s) noexcept;
// One step of a first-order lag. What dies away ends at 0: subnormal numbers cost a hundredfold.
[[nodiscard]] inline double lagged(double value, double target, double share) noexcept {
  const double next = value + share * (target - value);
  return next < 1e-30 && next > -1e-30 ? 0.0 : next;
}

}  // namespace cutforce::hal::host
