// Induction motor: the Gamma-equivalent circuit in stator coordinates, with saturation of the
// stator flux, iron loss and a stator resistance that warms up. Equations (S2)-(S9).
//   d psi_s/dt = e,  e = (u - R_s i_m)/(1 + R_s g),   i_s = i_m + g e
//   d psi_r/dt = -R_r i_r + j p w psi_r
//   i_r = (psi_r - psi_s)/L_ell,   i_m = psi_s/L_s - i_r,   L_s = L_su/(1 + (beta |psi_s|)^S)
//   T = 3/2 p Im(conj(psi_s) i_m)
// Peak-valued vectors, star-equivalent values: a delta winding has 3 times these resistances and
// inductances in each phase. No zero sequence, no space harmonics, no skin effect.
#pragma once

#include <cmath>

#include "hal/host/simulation/arithmetic.hpp"
#include "hal/host/simulation/complex.hpp"

namespace cutforce::hal::host {

struct MotorConfig {
  double pole_pairs;
  double stator_resistance_ohm;      // cold
  double rotor_resistance_ohm;       // Gamma
  double leakage_inductance_h;       // Gamma: all of it on the rotor side
  double stator_inductance_h;        // unsaturated
  double saturation_1_vs = 0.0;      // beta; 0: linear
  double saturation_exponent = 0.0;  // S
  double iron_conductance_s = 0.0;   // in parallel to d psi_s/dt
  double rated_flux_vs;              // stator flux at rated voltage and frequency
  double rated_speed_rad_s;          // electrical, of the supply
  double rated_torque_nm;
  double rated_current_a_rms;
  double resistance_slope_1_k = 0.0;    // copper: 0.0039
  double thermal_resistance_k_w = 0.0;  // rise per watt of stator copper loss; 0: stays cold
  double thermal_time_s = 600.0;
  double initial_rise_k = 0.0;
};

// The same motor given by its inverse-Gamma values (total leakage on the stator side), linear.
struct InverseGamma {
  double rotor_resistance_ohm;
  double leakage_inductance_h;
  double magnetizing_inductance_h;
};
void set_inverse_gamma(MotorConfig& motor, const InverseGamma& values) noexcept;
// Inverse-Gamma values at stator flux `flux_vs`, as a drive's commissioning would find them.
[[nodiscard]] InverseGamma inverse_gamma(const MotorConfig& motor, double flux_vs) noexcept;

struct MotorFlux {
  Complex stator_vs;
  Complex rotor_vs;
};

// What follows from flux, voltage and speed at one instant.
struct MotorInstant {
  Complex emf_v;          // d psi_s/dt
  Complex rotor_slope_v;  // d psi_r/dt
  Complex magnetic_current_a;
  Complex line_current_a;
  Complex rotor_current_a;
  double torque_nm;  // air gap, acting on the rotor
};

class InductionMotor {
 public:
  explicit InductionMotor(const MotorConfig& config) noexcept;

  [[nodiscard]] MotorInstant instant(const MotorFlux& flux, Complex voltage_v,
                                     double speed_rad_s) const noexcept;

  // Warms the winding by the mean copper loss over `step_s`; the torque loop never sees this.
  void warm(double stator_copper_w, double step_s) noexcept;

  [[nodiscard]] double stator_resistance_ohm() const noexcept { return stator_resistance_ohm_; }
  [[nodiscard]] double rise_k() const noexcept { return rise_k_; }
  [[nodiscard]] double stator_inductance_h(double flux_vs) const noexcept;
  // Losses and stored energy, (S7), (S8).
  [[nodiscard]] double stator_copper_w(const MotorInstant& at) const noexcept;
  [[nodiscard]] double rotor_copper_w(const MotorInstant& at) const noexcept;
  [[nodiscard]] double iron_w(const MotorInstant& at) const noexcept;
  [[nodiscard]] double magnetic_energy_j(const MotorFlux& flux) const noexcept;

 private:
  // (beta |psi|)^S from beta^2 |psi|^2.
  [[nodiscard]] double saturation(double flux_squared) const noexcept;
  void set_resistance() noexcept;

  MotorConfig config_;
  double rise_k_;
  double stator_resistance_ohm_ = 0.0;
  double inverse_leakage_1_h_;
  double inverse_inductance_1_h_;
  double emf_share_ = 1.0;  // 1/(1 + R_s g)
  double beta_squared_;
  int whole_exponent_;  // S where it is a small whole number, else -1
};

// Inline: called four times in every step.
inline double InductionMotor::saturation(double flux_squared) const noexcept {
  if (!(beta_squared_ > 0.0)) return 0.0;
  const double x = beta_squared_ * flux_squared;
  if (whole_exponent_ < 0) return power(x, 0.5 * config_.saturation_exponent);
  double result = whole_exponent_ % 2 == 1 ? std::sqrt(x) : 1.0;
  for (int k = whole_exponent_ / 2; k > 0; --k) result *= x;
  return result;
}

inline MotorInstant InductionMotor::instant(const MotorFlux& flux, Complex voltage_v,
                                            double speed_rad_s) const noexcept {
  MotorInstant at{};
  const double inverse_h =
      inverse_inductance_1_h_ * (1.0 + saturation(squared(flux.stator_vs)));  // (S4)
  at.rotor_current_a = inverse_leakage_1_h_ * (flux.rotor_vs - flux.stator_vs);
  at.magnetic_current_a = inverse_h * flux.stator_vs - at.rotor_current_a;
  at.emf_v = emf_share_ * (voltage_v - stator_resistance_ohm_ * at.magnetic_current_a);  // (S2)
  at.line_current_a = at.magnetic_current_a + config_.iron_conductance_s * at.emf_v;
  at.rotor_slope_v = (config_.pole_pairs * speed_rad_s) * turned_left(flux.rotor_vs) -
                     config_.rotor_resistance_ohm * at.rotor_current_a;                    // (S3)
  at.torque_nm = 1.5 * config_.pole_pairs * cross(flux.stator_vs, at.magnetic_current_a);  // (S5)
  return at;
}

}  // namespace cutforce::hal::host
