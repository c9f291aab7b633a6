// What moves between two events: motor flux, speed and angle of the shaft, and the anti-alias
// filters. Runge-Kutta of order 4 while the voltage is constant. Equations (S10)-(S13), (S18).
#pragma once

#include "hal/host/simulation/complex.hpp"
#include "hal/host/simulation/induction_motor.hpp"

namespace cutforce::hal::host {

struct SpindleConfig {
  double inertia_kg_m2;  // all that turns, seen from the motor
  double coulomb_torque_nm = 0.0;
  double viscous_nm_s_rad = 0.0;
  double gear_ratio = 1.0;  // motor turns per spindle turn
};

// Equal second-order Butterworth filters on voltage and current, as space vectors.
struct FilterState {
  Complex voltage_v;
  Complex voltage_slope_v_s;
  Complex current_a;
  Complex current_slope_a_s;
};

struct PlantState {
  MotorFlux flux{};
  double speed_rad_s = 0.0;
  double angle_rad = 0.0;  // of the motor shaft, not wrapped
  FilterState filter{};
};

// Constant between two events.
struct PlantInput {
  Complex voltage_v;
  double cut_load_nm = 0.0;     // cutting torque and the friction it causes
  double friction_ratio = 1.0;  // of Coulomb and viscous friction against the configured
};

class Plant {
 public:
  // filter_rad_s: corner of the anti-alias filters, 0 for none.
  Plant(const MotorConfig& motor, const SpindleConfig& spindle, double filter_rad_s) noexcept
      : motor_(motor),
        spindle_(spindle),
        inverse_inertia_1_kg_m2_(1.0 / spindle.inertia_kg_m2),
        filter_rad_s_(filter_rad_s) {}

  // One step; returns the charge vector, the integral of the line current, in A s.
  Complex step(PlantState& state, const PlantInput& input, double step_s) const noexcept;

  [[nodiscard]] MotorInstant instant(const PlantState& state,
                                     const PlantInput& input) const noexcept {
    return motor_.instant(state.flux, input.voltage_v, state.speed_rad_s);
  }
  // Coulomb and viscous friction at the motor, (S11).
  [[nodiscard]] double friction_nm(double speed_rad_s, const PlantInput& input) const noexcept;
  [[nodiscard]] InductionMotor& motor() noexcept { return motor_; }
  [[nodiscard]] const InductionMotor& motor() const noexcept { return motor_; }
  [[nodiscard]] const SpindleConfig& spindle() const noexcept { return spindle_; }

 private:
  struct Slope {
    MotorInstant motor;
    double acceleration_rad_s2;
  };
  [[nodiscard]] Slope slope(const MotorFlux& flux, double speed_rad_s,
                            const PlantInput& input) const noexcept;
  void filter(FilterState& state, const PlantInput& input, Complex begin_a, Complex middle_a,
              Complex end_a, double step_s) const noexcept;

  InductionMotor motor_;
  SpindleConfig spindle_;
  double inverse_inertia_1_kg_m2_;
  double filter_rad_s_;
};

}  // namespace cutforce::hal::host
