#include "hal/host/simulation/arithmetic.hpp"

#include <cmath>
#include <limits>

namespace cutforce::hal::host {
namespace {

// pi/2 and ln 2 in two parts: the first has trailing zeros, so its small multiples are exact.
constexpr double kHalfPiHigh = 1.57079632673412561417;
constexpr double kHalfPiLow = 6.07710050650619224932e-11;
constexpr double kLn2High = 6.93147180369123816490e-01;
constexpr double kLn2Low = 1.90821492927058770002e-10;

}  // namespace

SineCosine sine_cosine(double x_rad) noexcept {
  const double quarters = std::floor(x_rad * (2.0 / kPi) + 0.5);
  const double r = (x_rad - quarters * kHalfPiHigh) - quarters * kHalfPiLow;
  const double q = r * r;
  // Taylor sums; at pi/4 the first term left out is below 1e-16.
  const double s =
      r * (1.0 + q * (-1.0 / 6 +
                      q * (1.0 / 120 +
                           q * (-1.0 / 5040 +
                                q * (1.0 / 362880 + q * (-1.0 / 39916800 +
                                                         q * (1.0 / 6227020800.0 +
                                                              q * (-1.0 / 1307674368000.0))))))));
  const double c =
      1.0 +
      q * (-0.5 + q * (1.0 / 24 +
                       q * (-1.0 / 720 +
                            q * (1.0 / 40320 + q * (-1.0 / 3628800 +
                                                    q * (1.0 / 479001600.0 +
                                                         q * (-1.0 / 87178291200.0 +
                                                              q * (1.0 / 20922789888000.0))))))));
  const double turns = quarters * 0.25;
  switch (static_cast<int>(4.0 * (turns - std::floor(turns)))) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}

double exponential(double x) noexcept {
  if (x < -700.0) return 0.0;
  if (x > 700.0) return std::numeric_limits<double>::infinity();
  const double k = std::floor(x * 1.44269504088896340736 + 0.5);
  const double r = (x - k * kLn2High) - k * kLn2Low;
  double sum = 1.0;
  for (int n = 14; n > 0; --n) sum = 1.0 + sum * r / n;
  return std::ldexp(sum, static_cast<int>(k));
}

double logarithm(double x) noexcept {
  int exponent = 0;
  double m = std::frexp(x, &exponent);  // [0.5, 1)
  if (m < 0.70710678118654752440) {
    m *= 2.0;
    --exponent;
  }
  const double s = (m - 1.0) / (m + 1.0);
  const double q = s * s;
  const double tail =
      q * (1.0 / 3 +
           q * (1.0 / 5 +
                q * (1.0 / 7 +
                     q * (1.0 / 9 +
                          q * (1.0 / 11 +
                               q * (1.0 / 13 +
                                    q * (1.0 / 15 +
                                         q * (1.0 / 17 + q * (1.0 / 19 + q * (1.0 / 21))))))))));
  return exponent * kLn2High + (exponent * kLn2Low + 2.0 * (s + s * tail));
}

double power(double x, double y) noexcept {
  if (!(x > 0.0)) return 0.0;
  return exponential(y * logarithm(x));
}

double lag_share(double step_s, double time_s) noexcept {
  if (!(time_s > 0.0)) return 1.0;
  return 1.0 - exponential(-step_s / time_s);
}

}  // namespace cutforce::hal::host
