// Speed error that repeats with the shaft: encoder eccentricity, a belt, a coupling.
//
//   theta += w_m h;   e = a_1 cos theta + b_1 sin theta + a_2 cos 2 theta + b_2 sin 2 theta (E105)
// Learned from the unexplained rest of the speed while idle (stochastic gradient, 0.5 s), taken off
// the measured speed always. Applied only where it explains a good part of the rest: a transient or
// noise does not. Source: ESTIMATOR prototype 1.3, "once-per-revolution speed error".
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {

class SpeedRipple {
 public:
  struct State {
    std::array<float, 4> amplitude_rad_s{};  // a_1, b_1, a_2, b_2
    std::uint32_t turn = 0;                  // theta, 2^32 of it a turn
    float rest_variance = 0.0F;              // of what was learned from
    float learned_s = 0.0F;
    std::uint32_t applies = 0;
  };

  // Error of the speed measured over the tick that turns the shaft by speed_rad_s * duration_s.
  [[nodiscard]] constexpr float step(float speed_rad_s, float duration_s) noexcept {
    const float angle = speed_rad_s * duration_s;
    if (!(magnitude(angle) < kLargestAngle_rad)) return 0.0F;
    state_.turn += static_cast<std::uint32_t>(static_cast<std::int32_t>(angle * kPerRadian));
    return state_.applies != 0 ? dot(state_.amplitude_rad_s, waves()) : 0.0F;
  }

  // rest_rad_s: unexplained speed of the tick just stepped, before any ripple was taken off.
  constexpr void learn(float rest_rad_s, float duration_s) noexcept {
    const Waves wave = waves();
    const float error = rest_rad_s - dot(state_.amplitude_rad_s, wave);
    const float time_s = state_.learned_s < kTime_s ? state_.learned_s + duration_s : kTime_s;
    const float gain = 2.0F * duration_s / (time_s > 0.1F ? time_s : 0.1F);
    float power = 0.0F;
    for (std::size_t k = 0; k < wave.size(); ++k) {
      float& a = state_.amplitude_rad_s[k];
      a += gain * error * wave[k];
      power += a * a;
    }
    state_.rest_variance += 0.5F * gain * (error * error - state_.rest_variance);
    state_.learned_s += duration_s;
    if (state_.learned_s > kLongest_s) state_.learned_s = kLongest_s;
    const bool stands_out = power > kStandsOut_ratio * state_.rest_variance;
    state_.applies = state_.learned_s > kTime_s && stands_out ? 1U : 0U;
  }

  // The shaft was lost (a gap, standstill): the phase is unknown.
  constexpr void forget() noexcept { state_ = State{}; }

  [[nodiscard]] constexpr bool applies() const noexcept { return state_.applies != 0; }
  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kTime_s = 0.5F;
  static constexpr float kLongest_s = 100.0F;
  static constexpr float kLargestAngle_rad = 0.8F;
  static constexpr float kStandsOut_ratio = 0.5F;

  static constexpr float kPerRadian = 4294967296.0F / 6.28318530718F;

  using Waves = std::array<float, 4>;  // cos theta, sin theta, cos 2 theta, sin 2 theta

  [[nodiscard]] constexpr Waves waves() const noexcept {
    const auto half_turns = static_cast<float>(static_cast<std::int32_t>(state_.turn));
    const auto [c, s] = cosine_sine(half_turns * (1.0F / kPerRadian));
    return {c, s, c * c - s * s, 2.0F * c * s};
  }
  [[nodiscard]] static constexpr float dot(const Waves& a, const Waves& b) noexcept {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  }

  State state_{};
};

static_assert(std::is_trivially_copyable_v<SpeedRipple>);

}  // namespace cutforce::estimator
