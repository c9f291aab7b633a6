// Space vectors in double: alpha + j beta, peak-valued (amplitude invariant), stator coordinates.
// std::complex is not used: its product must obey Annex G and calls the library for every one.
#pragma once

#include <array>
#include <cmath>

namespace cutforce::hal::host {

struct Complex {
  double re = 0.0;
  double im = 0.0;

  constexpr Complex& operator+=(Complex b) noexcept {
    re += b.re;
    im += b.im;
    return *this;
  }
};

[[nodiscard]] constexpr Complex operator+(Complex a, Complex b) noexcept {
  return {a.re + b.re, a.im + b.im};
}
[[nodiscard]] constexpr Complex operator-(Complex a, Complex b) noexcept {
  return {a.re - b.re, a.im - b.im};
}
[[nodiscard]] constexpr Complex operator*(Complex a, Complex b) noexcept {
  return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}
[[nodiscard]] constexpr Complex operator*(double k, Complex a) noexcept {
  return {k * a.re, k * a.im};
}
[[nodiscard]] constexpr Complex conjugate(Complex a) noexcept { return {a.re, -a.im}; }
[[nodiscard]] constexpr Complex turned_left(Complex a) noexcept { return {-a.im, a.re}; }  // j a
[[nodiscard]] constexpr double squared(Complex a) noexcept { return a.re * a.re + a.im * a.im; }
[[nodiscard]] inline double magnitude(Complex a) noexcept { return std::sqrt(squared(a)); }
[[nodiscard]] constexpr double dot(Complex a, Complex b) noexcept {
  return a.re * b.re + a.im * b.im;
}
// Im(conj(a) b): twice the area from a to b.
[[nodiscard]] constexpr double cross(Complex a, Complex b) noexcept {
  return a.re * b.im - a.im * b.re;
}

inline constexpr double kHalfSqrt3 = 0.86602540378443864676;

// The three phase values, zero sequence 0, (S1).
[[nodiscard]] constexpr std::array<double, 3> to_phases(Complex a) noexcept {
  const double b = kHalfSqrt3 * a.im;
  return {a.re, -0.5 * a.re + b, -0.5 * a.re - b};
}
[[nodiscard]] constexpr Complex from_phases(const std::array<double, 3>& x) noexcept {
  return {(2.0 * x[0] - x[1] - x[2]) / 3.0, (x[1] - x[2]) / (2.0 * kHalfSqrt3)};
}

}  // namespace cutforce::hal::host
