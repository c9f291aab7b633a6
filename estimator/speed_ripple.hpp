// Speed error that repeats with the shaft: encoder eccentricity, a belt, a coupling.
//
//   theta += w_m h;   e = a_1 cos theta + b_1 sin theta + a_2 cos 2 theta + b_2 sin 2 theta (E105)
// Learned from the unexplained rest of the speed while idle (stochastic gradient, 0.5 s), taken off
// the measured speed always. Applied only where it explains a good part of the rest: a transient or
// noise does not. Source: ESTIMATOR prototype 1.3, "once-per-revolution speed error".
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {

class SpeedRipple {
 public:
  struct State {
    std::array<float, 4> amplitude_rad_s{};  // a_1, b_1, a_2, b_2
    float cosine = 1.0F;                     // of theta
    float sine = 0.0F;
    float rest_variance = 0.0F;  // of what was learned from
    float learned_s = 0.0F;
  };

  // Error of the speed measured over the tick that turns the shaft by speed_rad_s * duration_s.
  [[nodiscard]] constexpr float step(float speed_rad_s, float duration_s) noexcept {
    const float angle = speed_rad_s * duration_s;
    if (!(angle < kLargestAngle_rad && angle > -kLargestAngle_rad)) return 0.0F;
    const float c = cos_small(angle);
    const float s = sin_small(angle);
    const float x = state_.cosine * c - state_.sine * s;
    const float y = state_.sine * c + state_.cosine * s;
    const float scale = 1.5F - 0.5F * (x * x + y * y);
    state_.cosine = scale * x;
    state_.sine = scale * y;
    return applies() ? value() : 0.0F;
  }

  // rest_rad_s: unexplained speed of the tick just stepped, before any ripple was taken off.
  constexpr void learn(float rest_rad_s, float duration_s) noexcept {
    const float error = rest_rad_s - value();
    const float time_s = state_.learned_s < kTime_s ? state_.learned_s + duration_s : kTime_s;
    const float gain = 2.0F * duration_s / (time_s > 0.1F ? time_s : 0.1F);
    const float c2 = state_.cosine * state_.cosine - state_.sine * state_.sine;
    const float s2 = 2.0F * state_.cosine * state_.sine;
    state_.amplitude_rad_s[0] += gain * error * state_.cosine;
    state_.amplitude_rad_s[1] += gain * error * state_.sine;
    state_.amplitude_rad_s[2] += gain * error * c2;
    state_.amplitude_rad_s[3] += gain * error * s2;
    state_.rest_variance += 0.5F * gain * (error * error - state_.rest_variance);
    state_.learned_s += duration_s;
    if (state_.learned_s > kLongest_s) state_.learned_s = kLongest_s;
  }

  // The shaft was lost (a gap, standstill): the phase is unknown.
  constexpr void forget() noexcept { state_ = State{}; }

  [[nodiscard]] constexpr bool applies() const noexcept {
    if (!(state_.learned_s > kTime_s)) return false;
    float power = 0.0F;
    for (const float a : state_.amplitude_rad_s) power += a * a;
    return power > kStandsOut_ratio * state_.rest_variance;
  }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kTime_s = 0.5F;
  static constexpr float kLongest_s = 100.0F;
  static constexpr float kLargestAngle_rad = 0.8F;
  static constexpr float kStandsOut_ratio = 0.5F;

  [[nodiscard]] constexpr float value() const noexcept {
    const auto& a = state_.amplitude_rad_s;
    const float c2 = state_.cosine * state_.cosine - state_.sine * state_.sine;
    const float s2 = 2.0F * state_.cosine * state_.sine;
    return a[0] * state_.cosine + a[1] * state_.sine + a[2] * c2 + a[3] * s2;
  }

  State state_{};
};

static_assert(std::is_trivially_copyable_v<SpeedRipple>);

}  // namespace cutforce::estimator
