#include "hal/host/simulation/plant.hpp"

#include "hal/host/simulation/arithmetic.hpp"

namespace cutforce::hal::host {
namespace {

MotorFlux moved(const MotorFlux& flux, const MotorInstant& at, double step_s) noexcept {
  return {flux.stator_vs + step_s * at.emf_v, flux.rotor_vs + step_s * at.rotor_slope_v};
}

Complex weighted(Complex a, Complex b, Complex c, Complex d) noexcept {
  return (1.0 / 6.0) * (a + 2.0 * (b + c) + d);
}

}  // namespace

double Plant::friction_nm(double speed_rad_s, const PlantInput& input) const noexcept {
  return input.friction_ratio * (spindle_.coulomb_torque_nm * hyperbolic_tangent(speed_rad_s) +
                                 spindle_.viscous_nm_s_rad * speed_rad_s);  // (S11)
}

Plant::Slope Plant::slope(const MotorFlux& flux, double speed_rad_s,
                          const PlantInput& input) const noexcept {
  Slope result{.motor = motor_.instant(flux, input.voltage_v, speed_rad_s),
               .acceleration_rad_s2 = 0.0};
  result.acceleration_rad_s2 =
      (result.motor.torque_nm - input.cut_load_nm - friction_nm(speed_rad_s, input)) *
      inverse_inertia_1_kg_m2_;  // (S10)
  return result;
}

Complex Plant::step(PlantState& state, const PlantInput& input, double step_s) const noexcept {
  const double half_s = 0.5 * step_s;
  const MotorFlux& flux = state.flux;
  const double speed = state.speed_rad_s;
  const Slope a = slope(flux, speed, input);
  const double speed_b = speed + half_s * a.acceleration_rad_s2;
  const Slope b = slope(moved(flux, a.motor, half_s), speed_b, input);
  const double speed_c = speed + half_s * b.acceleration_rad_s2;
  const Slope c = slope(moved(flux, b.motor, half_s), speed_c, input);
  const double speed_d = speed + step_s * c.acceleration_rad_s2;
  const Slope d = slope(moved(flux, c.motor, step_s), speed_d, input);

  const Complex charge = step_s * weighted(a.motor.line_current_a, b.motor.line_current_a,
                                           c.motor.line_current_a, d.motor.line_current_a);
  if (filter_rad_s_ > 0.0) {
    const Complex middle = 0.5 * (b.motor.line_current_a + c.motor.line_current_a);
    filter(state.filter, input, a.motor.line_current_a, middle, d.motor.line_current_a, step_s);
  }
  state.angle_rad += step_s / 6.0 * (speed + 2.0 * (speed_b + speed_c) + speed_d);
  state.speed_rad_s =
      speed + step_s / 6.0 *
                  (a.acceleration_rad_s2 + 2.0 * (b.acceleration_rad_s2 + c.acceleration_rad_s2) +
                   d.acceleration_rad_s2);
  state.flux = {flux.stator_vs +
                    step_s * weighted(a.motor.emf_v, b.motor.emf_v, c.motor.emf_v, d.motor.emf_v),
                flux.rotor_vs + step_s * weighted(a.motor.rotor_slope_v, b.motor.rotor_slope_v,
                                                  c.motor.rotor_slope_v, d.motor.rotor_slope_v)};
  return charge;
}

void Plant::filter(FilterState& state, const PlantInput& input, Complex begin_a, Complex middle_a,
                   Complex end_a, double step_s) const noexcept {
  const double w = filter_rad_s_;
  constexpr double kDamping = 1.41421356237309504880;
  // y'' = w^2 (x - y) - sqrt(2) w y', (S18); x linear to second order over the step.
  const auto advance = [w, step_s](Complex& y, Complex& dy, Complex x0, Complex x1, Complex x2) {
    const auto bend = [w](Complex x, Complex value, Complex rate) {
      return (w * w) * (x - value) - (kDamping * w) * rate;
    };
    const double half_s = 0.5 * step_s;
    const Complex k1 = bend(x0, y, dy);
    const Complex dy2 = dy + half_s * k1;
    const Complex k2 = bend(x1, y + half_s * dy, dy2);
    const Complex dy3 = dy + half_s * k2;
    const Complex k3 = bend(x1, y + half_s * dy2, dy3);
    const Complex dy4 = dy + step_s * k3;
    const Complex k4 = bend(x2, y + step_s * dy3, dy4);
    y += step_s * weighted(dy, dy2, dy3, dy4);
    dy += step_s * weighted(k1, k2, k3, k4);
  };
  advance(state.voltage_v, state.voltage_slope_v_s, input.voltage_v, input.voltage_v,
          input.voltage_v);
  advance(state.current_a, state.current_slope_a_s, begin_a, middle_a, end_a);
}

}  // namespace cutforce::hal::host
