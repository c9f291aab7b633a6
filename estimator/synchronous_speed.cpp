#include "estimator/synchronous_speed.hpp"

namespace cutforce::estimator {

// On a copy of the state, which stays in registers.
bool SynchronousSpeed::add_run(std::span<const MotorSample> samples) noexcept {
  const float ohm = config_.stator_resistance_ohm;
  const float leakage_h = config_.leakage_inductance_h;
  const std::uint32_t end_after = config_.samples_per_window - end_samples_;
  State s = state_;
  for (const MotorSample& sample : samples) {
    const SpaceVector i = sample.current_a;
    const SpaceVector emf{.alpha = sample.voltage_v.alpha - ohm * i.alpha,
                          .beta = sample.voltage_v.beta - ohm * i.beta};
    s.flux_vs = {// (E28)
                 .alpha = flux_keep_ * s.flux_vs.alpha + flux_gain_s_ * (emf.alpha + s.emf_v.alpha),
                 .beta = flux_keep_ * s.flux_vs.beta + flux_gain_s_ * (emf.beta + s.emf_v.beta)};
    s.emf_v = emf;
    const SpaceVector rotor_flux{.alpha = s.flux_vs.alpha - leakage_h * i.alpha,
                                 .beta = s.flux_vs.beta - leakage_h * i.beta};
    const SpaceVector vector = config_.vector == Vector::kFlux ? rotor_flux : i;
    // Before the first sample stands the null vector, from which nothing has turned.
    const float turned = angle_of(dot(vector, s.vector), cross(vector, s.vector));
    s.vector = vector;

    ++s.sample;
    s.angle_rad += turned;
    if (s.sample > end_after) s.angle_end_rad += turned;
    s.flux_square_v2s2 += dot(rotor_flux, rotor_flux);
    s.current_square_a2 += dot(i, i);
  }
  state_ = s;
  return s.sample >= config_.samples_per_window;
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
