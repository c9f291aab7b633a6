#include "estimator/period_phasors.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace cutforce::host_tests {
namespace {

// What a window of n steps that misses a whole number of periods lets through, exactly.
double leak(double step, int n) {
  return std::fabs(std::sin(0.5 * step * n) / (n * std::sin(0.5 * step)));
}

TEST(PeriodPhasors, FindsTheFundamentalAndBothSequencesAndNoOffset) {
  for (const double step : {0.01, 0.1, 0.3, -0.3, 0.9, 2.0, 7.0}) {
    SCOPED_TRACE(step);
    estimator::PeriodPhasors phasors;
    double angle = 0.4;
    int n = 0;
    for (bool ended = false; !ended && n < 10000; ++n) {
      angle += step;
      const auto f = [](double x) { return static_cast<float>(x); };
      ended = phasors.step(
          {.channel = {f(3.0 * std::cos(angle) + 1.0), 0.0F, 5.0F, 0.0F, 0.0F, f(std::sin(angle))},
           .motor = {.voltage_v = {f(10.0 * std::cos(angle)), f(10.0 * std::sin(angle))},
                     .current_a = {f(3.0 * std::cos(angle)), f(std::sin(angle))}},
           .current_residual_a = 0.0F,
           .angle_rad = f(step)});
    }
    const auto out = phasors.result();
    const double of_offset = 2.0 * leak(step, n);  // a phasor is twice the mean
    const double of_twice = leak(2.0 * step, n);   // the fundamental against its mirror image
    EXPECT_LT(of_offset, 0.3) << "or the tests of a period mean nothing";
    EXPECT_NEAR(out.amplitude[0], 3.0, of_offset + 3.0 * of_twice + 1e-3);
    EXPECT_NEAR(out.amplitude[2], 0.0, 5.0 * of_offset + 1e-3);
    EXPECT_NEAR(out.amplitude[5], 1.0, of_twice + 1e-3);
    EXPECT_NEAR(out.mean[2], 5.0, 1e-4);
    EXPECT_NEAR(std::hypot(out.voltage_v.positive.alpha, out.voltage_v.positive.beta), 10.0, 1e-3);
    EXPECT_NEAR(std::hypot(out.current_a.positive.alpha, out.current_a.positive.beta), 2.0,
                of_twice + 1e-3);
    EXPECT_NEAR(std::hypot(out.current_a.negative.alpha, out.current_a.negative.beta), 1.0,
                2.0 * of_twice + 1e-3);
  }
}

}  // namespace
}  // namespace cutforce::host_tests
