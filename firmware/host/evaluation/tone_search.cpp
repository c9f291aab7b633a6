#include "firmware/host/evaluation/tone_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace cutforce::firmware::host {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;
constexpr double kHighest_hz = 450.0;
constexpr double kFewestPeriods = 3.0;
constexpr double kSecondTone_ratio = 0.2;
constexpr int kGoldenSteps = 40;

using Vector4 = std::array<double, 4>;
using Matrix4 = std::array<Vector4, 4>;

// Normal equations are symmetric and positive, so no pivots are needed; a direction in which the
// data hold nothing (a tone of frequency 0 is the mean) gets 0.
Vector4 solve(Matrix4 a, Vector4 b) {
  const Matrix4 whole = a;
  for (std::size_t c = 0; c < 4; ++c) {
    const bool empty = !(a[c][c] > 1e-9 * whole[c][c]);
    if (empty) {
      a[c] = {};
      a[c][c] = 1.0;
      b[c] = 0.0;
    }
    for (std::size_t r = c + 1; r < 4; ++r) {
      const double factor = empty ? 0.0 : a[r][c] / a[c][c];
      for (std::size_t k = c; k < 4; ++k) a[r][k] -= factor * a[c][k];
      b[r] -= factor * b[c];
    }
  }
  for (std::size_t c = 4; c-- > 0;) {
    for (std::size_t k = c + 1; k < 4; ++k) b[c] -= a[c][k] * b[k];
    b[c] /= a[c][c];
  }
  return b;
}

struct Regression {
  Vector4 coefficients;
  double residual;  // weighted sum of squares
};

// Time is taken from the middle of the stretch and scaled, so that the system is well conditioned.
Vector4 basis(double t, double middle_s, double half_s, double frequency_hz) {
  const double angle = kTwoPi * frequency_hz * t;
  return {1.0, (t - middle_s) / half_s, std::cos(angle), std::sin(angle)};
}

Regression regress(std::span<const double> t, std::span<const double> x, double frequency_hz) {
  const double half_s = std::max(0.5 * (t.back() - t.front()), 1e-9);
  const double middle_s = 0.5 * (t.back() + t.front());
  Matrix4 a{};
  Vector4 b{};
  double square = 0.0;
  for (std::size_t k = 0; k < t.size(); ++k) {
    const double c = std::cos(0.5 * std::numbers::pi * (t[k] - middle_s) / half_s);
    const double weight = c * c;
    const Vector4 row = basis(t[k], middle_s, half_s, frequency_hz);
    for (std::size_t r = 0; r < 4; ++r) {
      b[r] += weight * row[r] * x[k];
      for (std::size_t col = 0; col < 4; ++col) a[r][col] += weight * row[r] * row[col];
    }
    square += weight * x[k] * x[k];
  }
  Regression out{.coefficients = solve(a, b), .residual = square};
  for (std::size_t r = 0; r < 4; ++r) out.residual -= out.coefficients[r] * b[r];
  return out;
}

void subtract(std::span<const double> t, std::span<double> x, double frequency_hz) {
  const double half_s = std::max(0.5 * (t.back() - t.front()), 1e-9);
  const double middle_s = 0.5 * (t.back() + t.front());
  const auto fit = regress(t, x, frequency_hz).coefficients;
  for (std::size_t k = 0; k < t.size(); ++k) {
    const Vector4 row = basis(t[k], middle_s, half_s, frequency_hz);
    for (std::size_t r = 0; r < 4; ++r) x[k] -= fit[r] * row[r];
  }
}

// The frequency with the highest line of the Hann-weighted periodogram. Each sample keeps a phasor
// that is turned by one grid step at a time, which holds for irregular sampling too.
double highest_line_hz(std::span<const double> t, std::span<const double> x, double grid_hz) {
  const double length_s = t.back() - t.front();
  const double middle_s = 0.5 * (t.back() + t.front());
  const double first_hz = kFewestPeriods / length_s;
  const double nyquist_hz = 0.5 * static_cast<double>(t.size() - 1) / length_s;
  struct Phasor {
    double re, im, turn_re, turn_im;
  };
  std::vector<Phasor> phasors;
  phasors.reserve(t.size());
  for (std::size_t k = 0; k < t.size(); ++k) {
    const double c = std::cos(std::numbers::pi * (t[k] - middle_s) / length_s);
    const double angle = kTwoPi * first_hz * (t[k] - middle_s);
    const double turn = kTwoPi * grid_hz * (t[k] - middle_s);
    const double weighted = c * c * x[k];
    phasors.push_back(
        {weighted * std::cos(angle), weighted * std::sin(angle), std::cos(turn), std::sin(turn)});
  }
  double best_hz = 0.0;
  double best = 0.0;
  for (double f = first_hz; f <= std::min(kHighest_hz, 0.9 * nyquist_hz); f += grid_hz) {
    double re = 0.0;
    double im = 0.0;
    for (auto& p : phasors) {
      re += p.re;
      im += p.im;
      p = {p.re * p.turn_re - p.im * p.turn_im, p.re * p.turn_im + p.im * p.turn_re, p.turn_re,
           p.turn_im};
    }
    if (re * re + im * im <= best) continue;
    best = re * re + im * im;
    best_hz = f;
  }
  return best_hz;
}

double strongest_hz(std::span<const double> t, std::span<const double> x) {
  const double grid_hz = 0.25 / (t.back() - t.front());
  const double best_hz = highest_line_hz(t, x, grid_hz);
  constexpr double kGolden = 0.6180339887498949;
  double low = best_hz - 2.0 * grid_hz;
  double high = best_hz + 2.0 * grid_hz;
  for (int k = 0; k < kGoldenSteps && best_hz > 0.0; ++k) {
    const double a = high - kGolden * (high - low);
    const double b = low + kGolden * (high - low);
    if (regress(t, x, a).residual < regress(t, x, b).residual)
      high = b;
    else
      low = a;
  }
  return best_hz > 0.0 ? 0.5 * (low + high) : 0.0;
}

}  // namespace

ToneFit fit_tone(const std::vector<double>& time_s, const std::vector<double>& x,
                 double frequency_hz) {
  if (time_s.size() < 8) return {.cosine = 0.0, .sine = 0.0};
  const auto fit = regress(time_s, x, frequency_hz).coefficients;
  return {.cosine = fit[2], .sine = fit[3]};
}

std::vector<Tone> find_tones(std::span<const double> time_s, std::span<const double> torque_nm,
                             double smallest_nm) {
  std::vector<Tone> tones;
  const double length_s = time_s.back() - time_s.front();
  const double trim_s = std::min(std::max(0.1 * length_s, 0.1), 0.25 * length_s);
  const auto begin = std::lower_bound(time_s.begin(), time_s.end(), time_s.front() + trim_s);
  const auto end = std::upper_bound(time_s.begin(), time_s.end(), time_s.back() - trim_s);
  if (end - begin < 16) return tones;
  const std::span<const double> t(begin, end);
  const auto offset = static_cast<std::size_t>(begin - time_s.begin());
  const auto part = torque_nm.subspan(offset, t.size());
  std::vector<double> rest(part.begin(), part.end());
  subtract(t, rest, 0.0);  // mean and slope alone

  for (int k = 0; k < 2; ++k) {
    const double frequency_hz = strongest_hz(t, rest);
    if (!(frequency_hz > 0.0)) break;
    const auto fit = regress(t, rest, frequency_hz).coefficients;
    const double amplitude_nm = std::hypot(fit[2], fit[3]);
    subtract(t, rest, frequency_hz);
    if (amplitude_nm < smallest_nm) break;
    if (!tones.empty()) {
      const double order = frequency_hz / tones.front().frequency_hz;
      const double off_hz = std::abs(order - std::round(order)) * tones.front().frequency_hz;
      const bool harmonic = std::round(order) >= 1.0 && off_hz < 2.0 / (t.back() - t.front());
      if (harmonic || amplitude_nm < kSecondTone_ratio * tones.front().amplitude_nm) break;
    }
    tones.push_back({.from_s = t.front(),
                     .to_s = t.back(),
                     .frequency_hz = frequency_hz,
                     .amplitude_nm = amplitude_nm});
  }
  return tones;
}

}  // namespace cutforce::firmware::host
