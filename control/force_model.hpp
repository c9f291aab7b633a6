// From the override that was sent to the force that is read: dead time, feed servo, cut, estimate.
// Equations (C70)-(C75). Everything is linear in the log-linear feed w:
//
//   w = (u / u_0)^p (n_0 / n)^p                 u override, n spindle speed, p exponent on feed
//   tau_f dv/dt = w(t - L) - v                  feed servo; L dead time, PLC scan and CNC together
//   tau_p dF/dt = K v - F                       the cut; K force at u_0, unknown and changing
//   tau_s ds/dt = F - s                         the estimate
//
// so what the override does to the force is known, whatever limits and rounding made of it, and the
// whole uncertainty is K. Saturation is never a disturbance, and nothing can wind up.
#pragma once

#include <cstdint>

#include "estimator/polynomials.hpp"

namespace cutforce::control {

// Whether two lags are far enough from each other for partial fractions in single precision.
[[nodiscard]] constexpr bool apart(float lag_s, float other_s) noexcept {
  return estimator::magnitude(lag_s - other_s) >= 0.01F * other_s;
}

// Shares of first-order lags over one stretch of time, for one constant w.
struct LagStep {
  float length_s;
  float feed;          // e^(-d/tau_f)
  float feed_lags;     // tau_f/d; 0 of no time at all
  float cut;           // e^(-d/tau_p)
  float sensed;        // e^(-d/tau_s)
  float sensed_force;  // of the force at the begin
  float sensed_input;  // of K times the mean of v

  // Sensor and cut must be apart().
  [[nodiscard]] static constexpr LagStep of(float length_s, float feed_lag_s, float cut_lag_s,
                                            float sensor_lag_s) noexcept {
    const auto decay = [length_s](float lag_s) {
      return lag_s > 0.0F ? estimator::exp_bounded(-length_s / lag_s) : 0.0F;
    };
    LagStep step{.length_s = length_s,
                 .feed = decay(feed_lag_s),
                 .feed_lags = length_s > 0.0F ? feed_lag_s / length_s : 0.0F,
                 .cut = decay(cut_lag_s),
                 .sensed = decay(sensor_lag_s),
                 .sensed_force = 0.0F,
                 .sensed_input = 0.0F};
    step.sensed_force = (step.cut - step.sensed) * cut_lag_s / (cut_lag_s - sensor_lag_s);
    step.sensed_input = 1.0F - step.sensed - step.sensed_force;  // (C74)
    return step;
  }
};

// What follows from the override alone.
struct FeedState {
  float v = 0.0F;  // w-domain feed behind the servo

  // One stretch of constant w; returns the mean of v over it, and w over no time at all. (C72)
  [[nodiscard]] constexpr float advance(const LagStep& step, float w) noexcept {
    const float before = v;
    v = w + (v - w) * step.feed;
    return w - step.feed_lags * (v - before);
  }
};

}  // namespace cutforce::control
