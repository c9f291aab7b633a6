#include "firmware/host/design/step_response.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cutforce::firmware::host {

std::vector<double> step_response(const Polynomial& numerator, const Polynomial& denominator,
                                  std::size_t ticks) {
  const std::size_t late = denominator.size() - numerator.size();
  std::vector<double> y(ticks, 0.0);
  for (std::size_t i = 0; i < ticks; ++i) {
    double sum = 0.0;
    for (std::size_t k = 0; k < numerator.size() && k + late <= i; ++k) sum += numerator[k];
    for (std::size_t k = 1; k < denominator.size() && k <= i; ++k) sum -= denominator[k] * y[i - k];
    y[i] = sum / denominator.front();
  }
  return y;
}

LoopStep loop_step(const DiscretePlant& plant, const DiscreteController& controller,
                   double duration_s) {
  const auto ticks = static_cast<std::size_t>(std::ceil(duration_s / plant.period_s)) + 1;
  const auto poles = closed_loop(plant, controller);
  LoopStep step{
      .force = step_response(product(controller.numerator, plant.numerator), poles, ticks),
      .override = step_response(product(controller.numerator, plant.denominator), poles, ticks),
      .overshoot_ratio = 0.0,
      .settling_s = std::numeric_limits<double>::infinity()};
  const double gain = static_gain(plant);
  for (double& u : step.override) u *= gain;
  step.overshoot_ratio = std::max(0.0, *std::ranges::max_element(step.force) - 1.0);
  std::size_t settled = ticks;
  while (settled > 0 && std::abs(step.force[settled - 1] - 1.0) <= 0.05) --settled;
  if (settled < ticks) step.settling_s = static_cast<double>(settled) * plant.period_s;
  return step;
}

double highest_gain(const DiscretePlant& plant, const DiscreteController& controller) {
  const auto stable = [&](double ratio) {
    return is_stable(closed_loop(
        {product(plant.numerator, {ratio}), plant.denominator, plant.period_s}, controller));
  };
  if (!stable(1.0)) return 0.0;
  // Steps so small that no band of instability is jumped over, then halves.
  double low = 1.0;
  double high = 1.05;
  while (high < 1e3 && stable(high)) low = high, high *= 1.05;
  if (high >= 1e3) return std::numeric_limits<double>::infinity();
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (stable(middle) ? low : high) = middle;
  }
  return low * static_gain(plant);
}

}  // namespace cutforce::firmware::host
