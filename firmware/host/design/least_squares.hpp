// Nonlinear least squares of a handful of parameters: Gauss and Newton with Marquardt's damping,
// derivatives by differences.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <vector>

namespace cutforce::firmware::host {

inline constexpr std::size_t kParameterCount = 5;
using Parameters = std::array<double, kParameterCount>;
using Square = std::array<Parameters, kParameterCount>;

using Residual = std::function<std::vector<double>(const Parameters&)>;
using Bounds = std::function<Parameters(Parameters)>;  // the nearest allowed point

struct Fit {
  Parameters at;
  std::vector<double> residual;
  Square covariance;
};

// From `start` on; the covariance is still empty.
[[nodiscard]] Fit least_squares(const Parameters& start, const Residual& residual,
                                const Bounds& bounds);

// Covariance for residuals that are correlated over up to `rows` rows (Newey and West's weights):
// with one variance for all rows, and with each row's own; of the two, the one with the larger
// variance of each parameter.
void add_covariance(Fit& fit, const Residual& residual, std::size_t rows);

}  // namespace cutforce::firmware::host
