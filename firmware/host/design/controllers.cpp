#include <vector>

#include "firmware/host/design/linear_analysis.hpp"

namespace cutforce::firmware::host {

DiscreteController proportional(double gain) { return {{gain}, {1.0}}; }

DiscreteController controller_of(const control::PiController::Config& config) {
  const double proportional = static_cast<double>(config.proportional_pct_n);
  const double integral =
      static_cast<double>(config.integral_pct_n_s) * static_cast<double>(config.period_s);
  return {{proportional + integral, -proportional}, {1.0, -1.0}};
}

DiscreteController controller_of(const control::Pid::Config& config) {
  const double proportional = static_cast<double>(config.proportional_pct_n);
  const double period_s = static_cast<double>(config.period_s);
  const double derivative_s = static_cast<double>(config.derivative_time_s);
  const double filter_s = derivative_s / static_cast<double>(config.derivative_filter_ratio);
  const double integral = period_s / static_cast<double>(config.integral_time_s);
  const double filter = filter_s / (filter_s + period_s);
  const double derivative = derivative_s / (filter_s + period_s);
  // K_P (1 + (T / T_I) z / (z - 1) + K_d (z - 1) / (z - r)).
  const Polynomial lag{1.0, -filter};
  const Polynomial integrator{1.0, -1.0};
  const auto slow = product({1.0 + integral, -1.0}, lag);
  const auto fast = product({derivative, -derivative}, integrator);
  return {product({proportional}, sum(slow, fast)), product(integrator, lag)};
}

Polynomial closed_loop(const DiscretePlant& plant, const DiscreteController& controller) {
  return sum(product(controller.denominator, plant.denominator),
             product(controller.numerator, plant.numerator));
}

}  // namespace cutforce::firmware::host
