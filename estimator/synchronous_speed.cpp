#include "estimator/synchronous_speed.hpp"

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

// Angle by which `to` is ahead of `from`, rad, in (-pi, pi].
float angle_between(SpaceVector from, SpaceVector to) noexcept {
  return angle_of(dot(to, from), cross(to, from));
}

}  // namespace

auto SynchronousSpeed::step(const MotorSample& sample) noexcept -> std::optional<Output> {
  integrate_flux(sample);
  const SpaceVector rotor_flux{
      .alpha = state_.flux_vs.alpha - config_.leakage_inductance_h * sample.current_a.alpha,
      .beta = state_.flux_vs.beta - config_.leakage_inductance_h * sample.current_a.beta};
  const SpaceVector vector = config_.vector == Vector::kFlux ? rotor_flux : sample.current_a;
  const float turned = state_.started == 0 ? 0.0F : angle_between(state_.vector, vector);
  state_.vector = vector;
  state_.started = 1;

  ++state_.sample;
  state_.angle_rad += turned;
  if (state_.sample > config_.samples_per_window - end_samples_) state_.angle_end_rad += turned;
  state_.flux_square_v2s2 += dot(rotor_flux, rotor_flux);
  state_.current_square_a2 += dot(sample.current_a, sample.current_a);

  if (state_.sample < config_.samples_per_window) return std::nullopt;
  return close_window();
}

void SynchronousSpeed::integrate_flux(const MotorSample& sample) noexcept {
  const float ohm = config_.stator_resistance_ohm;
  const SpaceVector emf{.alpha = sample.voltage_v.alpha - ohm * sample.current_a.alpha,
                        .beta = sample.voltage_v.beta - ohm * sample.current_a.beta};
  // (E28)
  state_.flux_vs.alpha =
      flux_keep_ * state_.flux_vs.alpha + flux_gain_s_ * (emf.alpha + state_.emf_v.alpha);
  state_.flux_vs.beta =
      flux_keep_ * state_.flux_vs.beta + flux_gain_s_ * (emf.beta + state_.emf_v.beta);
  state_.emf_v = emf;
}

auto SynchronousSpeed::close_window() noexcept -> Output {
  const float count = static_cast<float>(config_.samples_per_window);
  const float end_count = static_cast<float>(end_samples_);
  const float electrical = state_.angle_rad / (count * config_.sample_period_s);  // (E26)
  const float amount = magnitude(electrical);
  const bool valid =
      amount >= config_.minimum_electrical_rad_s &&
      state_.current_square_a2 >= count * config_.minimum_current_a * config_.minimum_current_a;
  const float leak = valid ? config_.flux_leak_rad_s / electrical : 0.0F;
  const Output output{
      .electrical_rad_s = electrical,
      .synchronous_rad_s = electrical / config_.pole_pairs,  // (E27)
      .synchronous_end_rad_s =
          state_.angle_end_rad / (end_count * config_.sample_period_s * config_.pole_pairs),
      .flux_square_v2s2 = state_.flux_square_v2s2 / count * (1.0F + leak * leak),
      .valid = valid};
  state_.angle_rad = 0.0F;
  state_.angle_end_rad = 0.0F;
  state_.flux_square_v2s2 = 0.0F;
  state_.current_square_a2 = 0.0F;
  state_.sample = 0;
  return output;
}

}  // namespace cutforce::estimator
