#include "hal/host/simulation/induction_motor.hpp"

#include <cmath>

#include "hal/host/simulation/arithmetic.hpp"

namespace cutforce::hal::host {

void set_inverse_gamma(MotorConfig& motor, const InverseGamma& values) noexcept {
  const double stator_h = values.magnetizing_inductance_h + values.leakage_inductance_h;
  const double ratio = stator_h / values.magnetizing_inductance_h;  // (S9)
  motor.rotor_resistance_ohm = ratio * ratio * values.rotor_resistance_ohm;
  motor.leakage_inductance_h = ratio * values.leakage_inductance_h;
  motor.stator_inductance_h = stator_h;
  motor.saturation_1_vs = 0.0;
  motor.saturation_exponent = 0.0;
}

InverseGamma inverse_gamma(const MotorConfig& motor, double flux_vs) noexcept {
  const double stator_h = InductionMotor{motor}.stator_inductance_h(flux_vs);
  const double ratio = stator_h / (stator_h + motor.leakage_inductance_h);  // (S9)
  return {.rotor_resistance_ohm = ratio * ratio * motor.rotor_resistance_ohm,
          .leakage_inductance_h = ratio * motor.leakage_inductance_h,
          .magnetizing_inductance_h = ratio * stator_h};
}

InductionMotor::InductionMotor(const MotorConfig& config) noexcept
    : config_(config),
      rise_k_(config.initial_rise_k),
      inverse_leakage_1_h_(1.0 / config.leakage_inductance_h),
      inverse_inductance_1_h_(1.0 / config.stator_inductance_h),
      beta_squared_(config.saturation_1_vs * config.saturation_1_vs),
      whole_exponent_(-1) {
  const double s = config.saturation_exponent;
  if (s >= 1.0 && s <= 16.0 && std::floor(s) == s) whole_exponent_ = static_cast<int>(s);
  set_resistance();
}

void InductionMotor::set_resistance() noexcept {
  stator_resistance_ohm_ =
      config_.stator_resistance_ohm * (1.0 + config_.resistance_slope_1_k * rise_k_);
  emf_share_ = 1.0 / (1.0 + stator_resistance_ohm_ * config_.iron_conductance_s);
}

void InductionMotor::warm(double stator_copper_w, double step_s) noexcept {
  if (!(config_.thermal_resistance_k_w > 0.0)) return;
  const double settled_k = config_.thermal_resistance_k_w * stator_copper_w;
  rise_k_ += lag_share(step_s, config_.thermal_time_s) * (settled_k - rise_k_);  // (S6)
  set_resistance();
}

double InductionMotor::stator_inductance_h(double flux_vs) const noexcept {
  return config_.stator_inductance_h / (1.0 + saturation(flux_vs * flux_vs));
}

double InductionMotor::stator_copper_w(const MotorInstant& at) const noexcept {
  return 1.5 * stator_resistance_ohm_ * squared(at.line_current_a);
}
double InductionMotor::rotor_copper_w(const MotorInstant& at) const noexcept {
  return 1.5 * config_.rotor_resistance_ohm * squared(at.rotor_current_a);
}
double InductionMotor::iron_w(const MotorInstant& at) const noexcept {
  return 1.5 * config_.iron_conductance_s * squared(at.emf_v);
}

double InductionMotor::magnetic_energy_j(const MotorFlux& flux) const noexcept {
  const double q = squared(flux.stator_vs);
  const double main =
      inverse_inductance_1_h_ * q * (0.5 + saturation(q) / (config_.saturation_exponent + 2.0));
  const double leakage = 0.5 * inverse_leakage_1_h_ * squared(flux.rotor_vs - flux.stator_vs);
  return 1.5 * (main + leakage);  // (S8)
}

}  // namespace cutforce::hal::host
