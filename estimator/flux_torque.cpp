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

auto FluxTorque::coefficients(float frequency_rad_s, float period_s) const noexcept
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

auto FluxTorque::take() noexcept -> Window {
  Window window{.torque_nm = state_.torque_nm,
                .moment_nm = 0.0F,
                .power_w = 0.0F,
                .current_squared_a2 = dot(state_.current_a, state_.current_a),
                .duration_s = state_.elapsed_periods * config_.sample_period_s,
                .flux_v_s = state_.flux_v_s,
                .current_a = state_.current_a};
  if (state_.elapsed_periods > 0.0F) {
    const float per_period = 1.0F / state_.elapsed_periods;
    window.torque_nm = 0.5F * state_.torque_sum_nm * per_period;
    window.moment_nm = 0.5F * state_.moment_sum_nm * per_period * per_period;
    window.power_w = 1.5F * state_.power_sum_w * per_period;
    window.current_squared_a2 = state_.current_sum_a2 * per_period;
  }
  state_.torque_sum_nm = 0.0F;
  state_.moment_sum_nm = 0.0F;
  state_.power_sum_w = 0.0F;
  state_.current_sum_a2 = 0.0F;
  state_.elapsed_periods = 0.0F;
  return window;
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
