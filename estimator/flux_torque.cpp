#include "estimator/flux_torque.hpp"

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

// Beyond this angle of rotation between two samples the sinusoid is not resolved; the integral
// starts anew from the steady state.
constexpr float kLargestHalfAngle_rad = 1.0F;

constexpr SpaceVector times(SpaceVector a, SpaceVector b) noexcept {
  return {a.alpha * b.alpha - a.beta * b.beta, a.alpha * b.beta + a.beta * b.alpha};
}

}  // namespace

void FluxTorque::step_run(std::span<const MotorSample> samples) noexcept {
  if (samples.empty()) return;
  if (state_.samples == 0) [[unlikely]] {
    step(samples.front(), 1.0F);
    samples = samples.subspan(1);
    if (samples.empty()) return;
  }
  const float leak = state_.leak;
  const SpaceVector gain_s = state_.gain_s;
  const float ohm = config_.stator_resistance_ohm;
  const float torque_scale = torque_scale_;
  Running r = running();
  for (const MotorSample& sample : samples) {
    r.integrate(emf(sample, ohm), leak, gain_s);
    r.add(sample, torque_scale, 1.0F);
  }
  keep(r, samples.back().current_a);
}

void FluxTorque::step(const MotorSample& sample, float elapsed_periods) noexcept {
  const SpaceVector e = emf(sample, config_.stator_resistance_ohm);
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
  if (!resolved) {
    state_.emf_v = e;
    seed();
  }
  Running r = running();
  if (resolved) r.integrate(e, used.leak, used.gain_s);
  r.add(sample, torque_scale_, elapsed_periods);
  keep(r, sample.current_a);
}

void FluxTorque::seed() noexcept {
  const float w = state_.frequency_rad_s;
  const float size = magnitude(w);
  if (!(size > kSmallestFrequency_rad_s)) return;
  state_.flux_v_s = {state_.emf_v.beta / w, -state_.emf_v.alpha / w};  // e / (j w_e)
}

void FluxTorque::remove_offset(SpaceVector voltage_v, SpaceVector current_a) noexcept {
  const SpaceVector e =
      emf({.voltage_v = voltage_v, .current_a = current_a}, config_.stator_resistance_ohm);
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
