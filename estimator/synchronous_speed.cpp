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

}  // namespace cutforce::estimator
