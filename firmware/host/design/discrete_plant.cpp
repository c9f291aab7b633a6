#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <utility>
#include <vector>

#include "firmware/host/design/linear_analysis.hpp"

namespace cutforce::firmware::host {
namespace {

// Square, row-major.
struct Matrix {
  std::size_t size;
  std::vector<double> at;

  explicit Matrix(std::size_t n) : size(n), at(n * n, 0.0) {}
  [[nodiscard]] double& operator()(std::size_t row, std::size_t column) {
    return at[row * size + column];
  }
  [[nodiscard]] double operator()(std::size_t row, std::size_t column) const {
    return at[row * size + column];
  }
};

Matrix identity(std::size_t n) {
  Matrix one(n);
  for (std::size_t i = 0; i < n; ++i) one(i, i) = 1.0;
  return one;
}

Matrix operator*(const Matrix& a, const Matrix& b) {
  Matrix c(a.size);
  for (std::size_t i = 0; i < a.size; ++i) {
    for (std::size_t k = 0; k < a.size; ++k) {
      for (std::size_t j = 0; j < a.size; ++j) c(i, j) += a(i, k) * b(k, j);
    }
  }
  return c;
}

// exp(a): its series where it converges at once, then squared back.
Matrix exponential(Matrix a) {
  double norm = 0.0;
  for (const double element : a.at) norm += std::abs(element);
  const int halvings = norm > 0.25 ? static_cast<int>(std::ceil(std::log2(norm / 0.25))) : 0;
  for (double& element : a.at) element = std::ldexp(element, -halvings);
  Matrix result = identity(a.size);
  Matrix term = identity(a.size);
  for (int n = 1; n <= 14; ++n) {  // 0.25^15 / 15! is below 1e-21
    term = term * a;
    for (std::size_t i = 0; i < term.at.size(); ++i) {
      term.at[i] /= n;
      result.at[i] += term.at[i];
    }
  }
  for (int i = 0; i < halvings; ++i) result = result * result;
  return result;
}

using Vector = std::vector<double>;

// x(t) = transition x(0) + input u, with u held.
struct Held {
  Matrix transition;
  Vector input;
};

// Controllable canonical form over time_s: exp of [[A, B], [0, 0]].
Held hold(const Polynomial& monic, double time_s) {
  const std::size_t n = monic.size() - 1;
  Matrix generator(n + 1);
  for (std::size_t k = 0; k < n; ++k) generator(0, k) = -monic[k + 1] * time_s;
  for (std::size_t k = 1; k < n; ++k) generator(k, k - 1) = time_s;
  generator(0, n) = time_s;
  const Matrix flow = exponential(std::move(generator));
  Held held{Matrix(n), Vector(n)};
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < n; ++k) held.transition(i, k) = flow(i, k);
    held.input[i] = flow(i, n);
  }
  return held;
}

Vector times(const Matrix& a, const Vector& x) {
  Vector y(a.size, 0.0);
  for (std::size_t i = 0; i < a.size; ++i) {
    for (std::size_t k = 0; k < a.size; ++k) y[i] += a(i, k) * x[k];
  }
  return y;
}

double dot(const Vector& a, const Vector& b) {
  double total = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) total += a[i] * b[i];
  return total;
}

// c adj(zI - A) b and det(zI - A), by Faddeev and LeVerrier.
struct Transfer {
  Polynomial numerator;
  Polynomial denominator;
};
Transfer transfer(const Matrix& a, const Vector& b, const Vector& c) {
  Transfer result{{}, {1.0}};
  Matrix m = identity(a.size);
  for (std::size_t k = 1; k <= a.size; ++k) {
    result.numerator.push_back(dot(c, times(m, b)));
    m = a * m;
    double trace = 0.0;
    for (std::size_t i = 0; i < a.size; ++i) trace += m(i, i);
    const double coefficient = -trace / static_cast<double>(k);
    result.denominator.push_back(coefficient);
    for (std::size_t i = 0; i < a.size; ++i) m(i, i) += coefficient;
  }
  return result;
}

void multiply_by_z(Polynomial& polynomial, std::size_t power) {
  polynomial.insert(polynomial.end(), power, 0.0);
}

}  // namespace

ContinuousPlant second_order(double b, double a1, double a0) { return {{b}, {1.0, a1, a0}}; }

ContinuousPlant lags(double gain, std::initializer_list<double> time_constants_s) {
  ContinuousPlant plant{{gain}, {1.0}};
  for (const double time_constant_s : time_constants_s) {
    if (time_constant_s > 0.0)
      plant.denominator = product(plant.denominator, {time_constant_s, 1.0});
  }
  return plant;
}

DiscretePlant discretise(const ContinuousPlant& plant, double period_s, double delay_s) {
  // The delay is n periods and a rest; one that is a whole number but for rounding has no rest.
  const double periods = delay_s / period_s;
  const double whole = std::floor(periods + 1e-9);
  const double rest_s = periods - whole > 1e-9 ? delay_s - whole * period_s : 0.0;
  const auto ticks = static_cast<std::size_t>(whole);

  const double leading = plant.denominator.front();
  Polynomial monic = plant.denominator;
  for (double& coefficient : monic) coefficient /= leading;
  const std::size_t order = monic.size() - 1;
  if (order == 0) {
    DiscretePlant at_once{{plant.numerator.back() / leading}, {1.0}, period_s};
    multiply_by_z(at_once.denominator, ticks + 1);
    return at_once;
  }
  Vector output(order, 0.0);
  for (std::size_t i = 0; i < plant.numerator.size(); ++i)
    output[order - plant.numerator.size() + i] = plant.numerator[i] / leading;

  // Within a period the previous value acts for the rest of the delay, then the present one.
  const Held early = hold(monic, rest_s);
  const Held late = hold(monic, period_s - rest_s);
  const Matrix transition = late.transition * early.transition;
  const auto present = transfer(transition, late.input, output);
  DiscretePlant sampled{present.numerator, present.denominator, period_s};
  if (rest_s > 0.0) {
    const auto previous = transfer(transition, times(late.transition, early.input), output);
    multiply_by_z(sampled.numerator, 1);
    sampled.numerator = sum(sampled.numerator, previous.numerator);
    multiply_by_z(sampled.denominator, 1);
  }
  multiply_by_z(sampled.denominator, ticks);
  return sampled;
}

double static_gain(const DiscretePlant& plant) {
  return (value(plant.numerator, 1.0) / value(plant.denominator, 1.0)).real();
}

}  // namespace cutforce::firmware::host
