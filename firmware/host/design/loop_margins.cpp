#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <vector>

#include "firmware/host/design/linear_analysis.hpp"

namespace cutforce::firmware::host {
namespace {

using Complex = std::complex<double>;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kPi = std::numbers::pi;

// L on the unit circle; angle = omega T.
class OpenLoop {
 public:
  OpenLoop(const DiscretePlant& plant, const DiscreteController& controller)
      : numerator_(product(plant.numerator, controller.numerator)),
        denominator_(product(plant.denominator, controller.denominator)) {}

  [[nodiscard]] Complex at(double angle) const {
    const Complex z = std::polar(1.0, angle);
    return value(numerator_, z) / value(denominator_, z);
  }
  // z = -1 is real, and exactly so.
  [[nodiscard]] double at_the_end() const {
    return (value(numerator_, -1.0) / value(denominator_, -1.0)).real();
  }

 private:
  Polynomial numerator_;
  Polynomial denominator_;
};

// From far below every pole of a loop that settles within some 10^5 ticks to half the sampling
// rate: even steps of the logarithm, then even steps, where delays turn the phase.
std::vector<double> angles() {
  constexpr int kEach = 4000;
  std::vector<double> all;
  for (int i = 0; i < kEach; ++i) all.push_back(0.05 * std::pow(10.0, -4.0 + 4.0 * i / kEach));
  for (int i = 0; i < kEach; ++i) all.push_back(0.05 + (kPi - 0.05) * i / kEach);
  all.push_back(kPi * (1.0 - 1e-12));
  return all;
}

// The zero of `of` between two angles where its sign differs.
template <class Function>
double bisect(const Function& of, double low, double high) {
  const bool rises = of(low) < 0.0;
  for (int i = 0; i < 80; ++i) {
    const double middle = 0.5 * (low + high);
    ((of(middle) < 0.0) == rises ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

// Every angle at which `of` changes its sign.
template <class Function>
std::vector<double> crossings(const Function& of, const std::vector<double>& grid) {
  std::vector<double> found;
  double before = of(grid.front());
  for (std::size_t i = 1; i < grid.size(); ++i) {
    const double now = of(grid[i]);
    if ((before < 0.0) != (now < 0.0)) found.push_back(bisect(of, grid[i - 1], grid[i]));
    before = now;
  }
  return found;
}

struct RealCrossing {
  double angle;
  double value;  // below 0
};

// Where L cuts the negative real axis.
std::vector<RealCrossing> real_crossings(const OpenLoop& loop, const std::vector<double>& grid) {
  std::vector<RealCrossing> found;
  for (const double angle : crossings([&](double at) { return loop.at(at).imag(); }, grid)) {
    const double real = loop.at(angle).real();
    if (real < 0.0) found.push_back({angle, real});
  }
  if (loop.at_the_end() < 0.0) found.push_back({kPi, loop.at_the_end()});
  return found;
}

double smallest_distance(const OpenLoop& loop, const std::vector<double>& grid) {
  const auto distance = [&](double angle) { return std::abs(1.0 + loop.at(angle)); };
  std::size_t best = 0;
  for (std::size_t i = 1; i < grid.size(); ++i) {
    if (distance(grid[i]) < distance(grid[best])) best = i;
  }
  // Between its neighbours the distance has one minimum: thirds.
  double low = grid[best == 0 ? 0 : best - 1];
  double high = grid[std::min(best + 1, grid.size() - 1)];
  for (int i = 0; i < 100; ++i) {
    const double a = low + (high - low) / 3.0;
    const double b = high - (high - low) / 3.0;
    (distance(a) < distance(b) ? high : low) = distance(a) < distance(b) ? b : a;
  }
  return std::min({distance(low), distance(grid[best]), std::abs(1.0 + loop.at_the_end())});
}

}  // namespace

Ultimate ultimate(const DiscretePlant& plant) {
  Ultimate first{.gain = kInfinity, .period_s = 0.0};
  for (const auto& crossing : real_crossings({plant, proportional(1.0)}, angles())) {
    if (-1.0 / crossing.value < first.gain)
      first = {-1.0 / crossing.value, 2.0 * kPi / crossing.angle * plant.period_s};
  }
  return first;
}

Margins margins(const DiscretePlant& plant, const DiscreteController& controller) {
  if (!is_stable(closed_loop(plant, controller))) return {false, 0.0, 0.0, 0.0, 0.0, kInfinity};
  const OpenLoop loop(plant, controller);
  const auto grid = angles();
  Margins result{true, kInfinity, kInfinity, kInfinity, smallest_distance(loop, grid), 0.0};
  for (const auto& crossing : real_crossings(loop, grid)) {
    if (crossing.value > -1.0)
      result.gain_ratio = std::min(result.gain_ratio, -1.0 / crossing.value);
  }
  const auto beyond_one = [&](double angle) { return std::abs(loop.at(angle)) - 1.0; };
  for (const double angle : crossings(beyond_one, grid)) {
    double lag = kPi + std::arg(loop.at(angle));
    if (lag <= 0.0) lag += 2.0 * kPi;
    result.phase_rad = std::min(result.phase_rad, lag);
    result.delay_s = std::min(result.delay_s, lag / angle * plant.period_s);
  }
  result.peak_sensitivity = 1.0 / result.modulus_ratio;
  return result;
}

}  // namespace cutforce::firmware::host
