#include "estimator/period_phasors.hpp"

#include <cmath>
#include <cstddef>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kTurn = 6.28318531F;

constexpr float wrapped(float angle_rad) noexcept {
  const float turns = angle_rad * (1.0F / kTurn);
  if (!(turns > -1e6F && turns < 1e6F)) return 0.0F;
  return angle_rad - kTurn * static_cast<float>(
                                 static_cast<std::int32_t>(turns + (turns < 0.0F ? -0.5F : 0.5F)));
}

}  // namespace

void PeriodPhasors::begin() noexcept {
  const float theta = state_.theta_rad;
  state_ = State{};
  state_.theta_rad = theta;
}

bool PeriodPhasors::step(const Input& input) noexcept {
  const float advance = std::fabs(input.angle_rad);
  if (state_.observations == 0) {
    const float turns = static_cast<float>(kLeastObservations) * advance * (1.0F / kTurn);
    state_.target_rad =
        kTurn * static_cast<float>(1 + static_cast<std::int32_t>(turns < 1e3F ? turns : 1e3F));
  }
  state_.theta_rad = wrapped(state_.theta_rad + input.angle_rad);
  const CosineSine e = cosine_sine(state_.theta_rad);
  const auto add = [this, e](std::size_t k, float signal) {  // (E12)
    state_.cosine_sum[k] += signal * e.cosine;
    state_.sine_sum[k] += signal * e.sine;
  };
#pragma GCC unroll 6
  for (std::size_t k = 0; k < kChannels; ++k) {
    add(k, input.channel[k]);
    state_.sum[k] += input.channel[k];
  }
  add(6, input.current_residual_a);
  add(7, input.motor.voltage_v.alpha);
  add(8, input.motor.voltage_v.beta);
  add(9, input.motor.current_a.alpha);
  add(10, input.motor.current_a.beta);
  state_.current_square_sum += dot(input.motor.current_a, input.motor.current_a);
  ++state_.observations;
  // The interval before the first observation belongs to the window: N observations stand for N
  // intervals.
  state_.swept_rad += advance;
  return state_.swept_rad >= state_.target_rad - 0.5F * advance &&
         state_.observations >= kLeastObservations;
}

auto PeriodPhasors::result() const noexcept -> Result {
  const auto& c = state_.cosine_sum;
  const auto& s = state_.sine_sum;
  const float share = 1.0F / static_cast<float>(state_.observations > 0 ? state_.observations : 1U);
  const auto peak = [&](std::size_t k) {
    return 2.0F * share * std::sqrt(c[k] * c[k] + s[k] * s[k]);
  };
  const auto sequences = [&](std::size_t a, std::size_t b) {  // (E13)
    return Sequences{.positive = {share * (c[a] + s[b]), share * (c[b] - s[a])},
                     .negative = {share * (c[a] - s[b]), -share * (c[b] + s[a])}};
  };
  Result out{};
  for (std::size_t k = 0; k < kChannels; ++k) {
    out.amplitude[k] = peak(k);
    out.mean[k] = share * state_.sum[k];
  }
  out.residual_a = peak(6);
  out.voltage_v = sequences(7, 8);
  out.current_a = sequences(9, 10);
  const float turning = dot(out.current_a.positive, out.current_a.positive) +
                        dot(out.current_a.negative, out.current_a.negative);
  const float all = share * state_.current_square_sum;
  out.coherence = all > 0.0F ? turning / all : 0.0F;
  return out;
}

}  // namespace cutforce::estimator
