#include "estimator/raw_pwm.hpp"

#include <algorithm>
#include <cmath>

namespace cutforce::estimator {
namespace {

constexpr float kZero = 0.05F * 0.05F;
constexpr float kLong = 0.8F * 0.8F;
constexpr float kCorner = 0.0669872981F;  // sin^2(3 * 5 degrees)
constexpr float kZeroShare = 0.05F;
constexpr float kSevenShare = 0.95F;
constexpr float kSixth_rad = 1.04719755F;
// A sine in step with the sampling must move this much between the corners to be told from them:
// more than twice the 10 degrees that count as a corner.
constexpr float kSpread_rad = 0.42F;
constexpr std::uint32_t kLeastObservations = 20;

}  // namespace

bool RawPwmDetector::step(const Input& input) noexcept {
  const SpaceVector v = input.motor.voltage_v;
  const SpaceVector i = input.motor.current_a;
  const float squared = dot(v, v);
  state_.largest_squared_v2 = std::max(state_.largest_squared_v2, squared);
  const float largest = std::max(state_.largest_squared_v2, state_.largest_before_v2);
  if (squared <= kZero * largest) {
    ++state_.zeros;
  } else {
    const float a = v.alpha * v.alpha;
    const float b = v.beta * v.beta;
    const float triple = 3.0F * a - b;  // |v|^3 sin(3 angle) = beta (3 alpha^2 - beta^2), (E16)
    if (squared > kLong * largest && b * triple * triple <= kCorner * squared * squared * squared)
      ++state_.corners;
  }
  const float scale = dot(i, i) + dot(state_.last_current_a, state_.last_current_a);
  if (state_.observations > 0 && scale > 0.0F) {
    state_.turned_rad += 2.0F * cross(i, state_.last_current_a) / scale;
    state_.swept_rad += input.angle_rad;
  }
  state_.last_current_a = i;
  state_.elapsed_s += input.elapsed_s;
  ++state_.observations;
  if (state_.elapsed_s >= kWindow_s && state_.observations >= kLeastObservations) close_window();
  return state_.suspicious >= 2;
}

void RawPwmDetector::close_window() noexcept {
  const float n = static_cast<float>(state_.observations);
  const float zeros = static_cast<float>(state_.zeros);
  const float seven = static_cast<float>(state_.zeros + state_.corners);
  const float advance = std::fabs(state_.swept_rad) / n;
  const float sixths = std::min(advance / kSixth_rad, 1e6F);
  const float off_step =
      kSixth_rad * std::fabs(sixths - static_cast<float>(static_cast<std::int32_t>(sixths + 0.5F)));
  // A frequency that is announced while the current stands is no turning.
  const bool turning =
      std::fabs(state_.swept_rad) > 0.5F &&
      std::fabs(state_.turned_rad) > 0.4F * std::min(std::fabs(state_.swept_rad), n);
  const bool raw = zeros >= kZeroShare * n ||  // (E17)
                   (seven >= kSevenShare * n && off_step * n > kSpread_rad);
  State next{};
  next.last_current_a = state_.last_current_a;
  next.largest_before_v2 = state_.largest_squared_v2;
  next.suspicious = turning && raw ? state_.suspicious + 1 : 0;
  state_ = next;
}

}  // namespace cutforce::estimator
