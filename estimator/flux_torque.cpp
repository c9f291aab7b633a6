#include "estimator/flux_torque.hpp"

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

// Beyond this angle of rotation between two samples the sinusoid is not resolved; the integral
// starts anew from the steady state.
constexpr float kLargestHalfAngle_rad = 1.0F;
constexpr float kSmallestFrequency_rad_s = 6.0F;  // below it the phase of the leak is not corrected
constexpr float kSlowestLeak_rad_s = 10.0F;       // the leak never acts slower than at this w_e

constexpr SpaceVector times(SpaceVector a, SpaceVector b) noexcept {
  return {a.alpha * b.alpha - a.beta * b.beta, a.alpha * b.beta + a.beta * b.alpha};
}

}  // namespace

auto FluxTorque::make(const Config& config) noexcept -> std::expected<FluxTorque, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  FluxTorque block{config};
  block.set_frequency(0.0F);
  return block;
}

[[gnu::always_inline]] inline auto FluxTorque::coefficients(float frequency_rad_s,
                                                            float period_s) const noexcept
    -> Coefficients {
  const float size = magnitude(frequency_rad_s);
  const float acting = size > kSlowestLeak_rad_s ? size : kSlowestLeak_rad_s;
  const float leaked = config_.leak_ratio * acting * period_s;
  const float a = leaked < 0.5F ? 1.0F - leaked : 0.5F;
  const float half_angle = 0.5F * frequency_rad_s * period_s;
  const float t_over_w = 0.5F * period_s * tan_over_x(half_angle);  // t / w_e
  const float leak_over_w = size > kSmallestFrequency_rad_s ? (1.0F - a) / frequency_rad_s : 0.0F;
  return {.leak = a, .gain_s = {0.5F * t_over_w * (1.0F + a), -0.5F * leak_over_w}};  // (E64)
}

void FluxTorque::set_frequency(float frequency_rad_s) noexcept {
  const auto [leak, gain] = coefficients(frequency_rad_s, config_.sample_period_s);
  state_.leak = leak;
  state_.gain_s = gain;
  state_.frequency_rad_s = frequency_rad_s;
}

void FluxTorque::step_apart(const MotorSample& sample, float elapsed_periods) noexcept {
  const SpaceVector e = emf(sample.voltage_v, sample.current_a);
  Coefficients used{.leak = state_.leak, .gain_s = state_.gain_s};
  bool resolved = true;
  if (elapsed_periods != 1.0F) {
    const float period_s = elapsed_periods * config_.sample_period_s;
    const float half_angle = 0.5F * state_.frequency_rad_s * period_s;
    resolved = half_angle < kLargestHalfAngle_rad && half_angle > -kLargestHalfAngle_rad;
    if (resolved) used = coefficients(state_.frequency_rad_s, period_s);
  }
  if (state_.samples == 0) {
    state_.emf_v = e;
    state_.samples = 1;
  }
  if (resolved) {
    integrate(e, used.leak, used.gain_s);
  } else {
    state_.emf_v = e;
    seed();
  }
  add(sample, e, elapsed_periods);
}

void FluxTorque::seed() noexcept {
  const float w = state_.frequency_rad_s;
  const float size = magnitude(w);
  if (!(size > kSmallestFrequency_rad_s)) return;
  state_.flux_v_s = {state_.emf_v.beta / w, -state_.emf_v.alpha / w};  // e / (j w_e)
}

void FluxTorque::remove_offset(SpaceVector voltage_v, SpaceVector current_a) noexcept {
  const SpaceVector e = emf(voltage_v, current_a);
  state_.emf_v = {state_.emf_v.alpha - e.alpha, state_.emf_v.beta - e.beta};
  state_.current_a = {state_.current_a.alpha - current_a.alpha,
                      state_.current_a.beta - current_a.beta};
  const float forgotten = 1.0F - state_.leak;
  if (!(forgotten > 0.0F)) return;
  const SpaceVector left = times(state_.gain_s, e);
  state_.flux_v_s = {state_.flux_v_s.alpha - 2.0F * left.alpha / forgotten,
                     state_.flux_v_s.beta - 2.0F * left.beta / forgotten};
}

}  // namespace cutforce::estimator
