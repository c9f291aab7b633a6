#include "firmware/host/design/least_squares.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cutforce::firmware::host {
namespace {

constexpr std::size_t kN = kParameterCount;

double sum_of_squares(const std::vector<double>& r) {
  double sum = 0.0;
  for (const double x : r) sum += x * x;
  return sum;
}

// Derivatives of the residual, one row of them for each of its rows.
std::vector<Parameters> derivatives(const Parameters& at, const Residual& residual) {
  std::vector<Parameters> rows;
  for (std::size_t j = 0; j < kN; ++j) {
    const double step = 1e-4 * std::max(std::abs(at[j]), 0.1);
    Parameters up = at;
    Parameters down = at;
    up[j] += step;
    down[j] -= step;
    const auto high = residual(up);
    const auto low = residual(down);
    rows.resize(high.size());
    for (std::size_t k = 0; k < high.size(); ++k) rows[k][j] = (high[k] - low[k]) / (2.0 * step);
  }
  return rows;
}

Square normal_matrix(const std::vector<Parameters>& rows) {
  Square a{};
  for (const auto& row : rows) {
    for (std::size_t i = 0; i < kN; ++i) {
      for (std::size_t j = 0; j < kN; ++j) a[i][j] += row[i] * row[j];
    }
  }
  return a;
}

// Gauss and Jordan with pivots. Scaled to a diagonal of ones first: the parameters have very
// different units. What cannot be told apart gets a large variance, not an infinite one.
Square inverse(const Square& matrix) {
  Parameters scale{};
  for (std::size_t i = 0; i < kN; ++i)
    scale[i] = matrix[i][i] > 0.0 ? 1.0 / std::sqrt(matrix[i][i]) : 1.0;
  Square a{};
  Square b{};
  for (std::size_t i = 0; i < kN; ++i) {
    for (std::size_t j = 0; j < kN; ++j) a[i][j] = matrix[i][j] * scale[i] * scale[j];
    a[i][i] += 1e-12;
    b[i][i] = 1.0;
  }
  for (std::size_t c = 0; c < kN; ++c) {
    std::size_t pivot = c;
    for (std::size_t r = c + 1; r < kN; ++r) {
      if (std::abs(a[r][c]) > std::abs(a[pivot][c])) pivot = r;
    }
    std::swap(a[c], a[pivot]);
    std::swap(b[c], b[pivot]);
    const double divisor = a[c][c];
    for (std::size_t j = 0; j < kN; ++j) a[c][j] /= divisor, b[c][j] /= divisor;
    for (std::size_t r = 0; r < kN; ++r) {
      const double factor = r == c ? 0.0 : a[r][c];
      for (std::size_t j = 0; j < kN; ++j) a[r][j] -= factor * a[c][j], b[r][j] -= factor * b[c][j];
    }
  }
  for (std::size_t i = 0; i < kN; ++i) {
    for (std::size_t j = 0; j < kN; ++j) b[i][j] *= scale[i] * scale[j];
  }
  return b;
}

Square operator*(const Square& a, const Square& b) {
  Square c{};
  for (std::size_t i = 0; i < kN; ++i) {
    for (std::size_t k = 0; k < kN; ++k) {
      for (std::size_t j = 0; j < kN; ++j) c[i][j] += a[i][k] * b[k][j];
    }
  }
  return c;
}

// Sum over pairs of rows at most `rows` apart of weight(k, l) J_k J_l^T.
template <class Weight>
Square middle(const std::vector<Parameters>& jacobian, std::size_t rows, const Weight& weight) {
  Square sum{};
  for (std::size_t apart = 0; apart <= rows; ++apart) {
    const double fades = 1.0 - static_cast<double>(apart) / static_cast<double>(rows + 1);
    for (std::size_t k = apart; k < jacobian.size(); ++k) {
      const double w = fades * weight(k, k - apart);
      for (std::size_t i = 0; i < kN; ++i) {
        for (std::size_t j = 0; j < kN; ++j) {
          const double both = jacobian[k][i] * jacobian[k - apart][j];
          const double back = jacobian[k - apart][i] * jacobian[k][j];
          sum[i][j] += w * (apart == 0 ? both : both + back);
        }
      }
    }
  }
  return sum;
}

}  // namespace

Fit least_squares(const Parameters& start, const Residual& residual, const Bounds& bounds) {
  Fit fit{.at = bounds(start), .residual = {}, .covariance = {}};
  fit.residual = residual(fit.at);
  double best = sum_of_squares(fit.residual);
  double damping = 1e-3;
  for (int iteration = 0; iteration < 60; ++iteration) {
    const auto jacobian = derivatives(fit.at, residual);
    Parameters gradient{};
    for (std::size_t k = 0; k < jacobian.size(); ++k) {
      for (std::size_t i = 0; i < kN; ++i) gradient[i] += jacobian[k][i] * fit.residual[k];
    }
    const Square normal = normal_matrix(jacobian);
    bool better = false;
    double gained = 0.0;
    while (!better && damping < 1e10) {
      Square damped = normal;
      for (std::size_t i = 0; i < kN; ++i) damped[i][i] *= 1.0 + damping;
      const Square solve = inverse(damped);
      Parameters next = fit.at;
      for (std::size_t i = 0; i < kN; ++i) {
        for (std::size_t j = 0; j < kN; ++j) next[i] -= solve[i][j] * gradient[j];
      }
      next = bounds(next);
      auto left = residual(next);
      const double now = sum_of_squares(left);
      better = now < best;
      damping *= better ? 0.2 : 5.0;
      if (!better) continue;
      gained = best - now;
      best = now;
      fit.at = next;
      fit.residual = std::move(left);
    }
    if (!better || gained < 1e-10 * best) break;
  }
  return fit;
}

void add_covariance(Fit& fit, const Residual& residual, std::size_t rows) {
  const auto jacobian = derivatives(fit.at, residual);
  const auto& r = fit.residual;
  rows = std::min(rows, r.size() / 4);
  const double freedom = static_cast<double>(r.size() - kN);
  std::vector<double> covariance(rows + 1, 0.0);  // of residuals so many rows apart
  for (std::size_t apart = 0; apart <= rows; ++apart) {
    for (std::size_t k = apart; k < r.size(); ++k) covariance[apart] += r[k] * r[k - apart];
    covariance[apart] /= freedom;
  }
  const Square outer = inverse(normal_matrix(jacobian));
  const auto one = [&](std::size_t k, std::size_t l) { return covariance[k - l]; };
  const auto own = [&](std::size_t k, std::size_t l) {
    return r[k] * r[l] * static_cast<double>(r.size()) / freedom;
  };
  const Square even = outer * middle(jacobian, rows, one) * outer;
  const Square uneven = outer * middle(jacobian, rows, own) * outer;
  for (std::size_t i = 0; i < kN; ++i) {
    for (std::size_t j = 0; j < kN; ++j) {
      // Scaled, so that it stays a covariance.
      const double wider = std::sqrt(std::max(1.0, uneven[i][i] / even[i][i]) *
                                     std::max(1.0, uneven[j][j] / even[j][j]));
      fit.covariance[i][j] = even[i][j] * wider;
    }
  }
}

}  // namespace cutforce::firmware::host
