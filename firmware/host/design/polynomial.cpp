#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <utility>
#include <vector>

#include "firmware/host/design/linear_analysis.hpp"

namespace cutforce::firmware::host {

Polynomial product(const Polynomial& a, const Polynomial& b) {
  Polynomial c(a.size() + b.size() - 1, 0.0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t k = 0; k < b.size(); ++k) c[i + k] += a[i] * b[k];
  }
  return c;
}

Polynomial sum(const Polynomial& a, const Polynomial& b) {
  const Polynomial& longer = a.size() < b.size() ? b : a;
  const Polynomial& shorter = a.size() < b.size() ? a : b;
  Polynomial c = longer;
  const std::size_t offset = longer.size() - shorter.size();
  for (std::size_t i = 0; i < shorter.size(); ++i) c[offset + i] += shorter[i];
  return c;
}

std::complex<double> value(const Polynomial& polynomial, std::complex<double> at) {
  std::complex<double> result = 0.0;
  for (const double coefficient : polynomial) result = result * at + coefficient;
  return result;
}

std::vector<std::complex<double>> roots(const Polynomial& polynomial) {
  // Delays leave roots of high multiplicity at 0, where the iteration is slow: taken out first.
  Polynomial monic = polynomial;
  std::vector<std::complex<double>> at_zero;
  while (monic.size() > 1 && monic.back() == 0.0) {
    monic.pop_back();
    at_zero.emplace_back(0.0);
  }
  const double leading = monic.front();
  for (double& coefficient : monic) coefficient /= leading;

  // Durand-Kerner, from a circle that no root of the polynomial is the centre of.
  const std::size_t degree = monic.size() - 1;
  double radius = 0.0;
  for (std::size_t i = 1; i <= degree; ++i)
    radius = std::max(radius, std::pow(std::abs(monic[i]), 1.0 / static_cast<double>(i)));
  std::vector<std::complex<double>> root(degree);
  for (std::size_t i = 0; i < degree; ++i) {
    const double turn = (static_cast<double>(i) + 0.37) / static_cast<double>(degree);
    root[i] = std::polar(radius, 2.0 * std::numbers::pi * turn);
  }
  constexpr int kIterations = 500;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    double moved = 0.0;
    for (std::size_t i = 0; i < degree; ++i) {
      std::complex<double> others = 1.0;
      for (std::size_t k = 0; k < degree; ++k) {
        if (k != i) others *= root[i] - root[k];
      }
      if (others == 0.0) others = 1e-300;
      const auto change = value(monic, root[i]) / others;
      root[i] -= change;
      moved = std::max(moved, std::abs(change));
    }
    if (!(moved > 1e-15 * radius)) break;
  }
  root.insert(root.end(), at_zero.begin(), at_zero.end());
  return root;
}

double spectral_radius(const Polynomial& polynomial) {
  double radius = 0.0;
  for (const auto& root : roots(polynomial)) radius = std::max(radius, std::abs(root));
  return radius;
}

bool is_stable(const Polynomial& polynomial) {
  // Stable iff |last| < |first|, and what (first p - last reversed p) / z leaves is stable.
  Polynomial now = polynomial;
  while (now.size() > 1) {
    const double first = now.front();
    const double last = now.back();
    if (!(std::abs(last) < std::abs(first))) return false;
    Polynomial next(now.size() - 1);
    for (std::size_t i = 0; i < next.size(); ++i)
      next[i] = now[i] - last / first * now[now.size() - 1 - i];
    now = std::move(next);
  }
  return true;
}

}  // namespace cutforce::firmware::host
