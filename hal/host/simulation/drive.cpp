#include "hal/host/simulation/drive.hpp"

#include <algorithm>
#include <cmath>

#include "hal/host/simulation/arithmetic.hpp"

namespace cutforce::hal::host {
namespace {

Complex unit(double angle_rad) noexcept {
  const auto [sine, cosine] = sine_cosine(angle_rad);
  return {cosine, sine};
}

}  // namespace

Drive::Drive(const DriveConfig& config, const MotorConfig& motor, double inertia_kg_m2,
             double dc_link_v) noexcept
    : config_(config),
      pole_pairs_(motor.pole_pairs),
      resistance_ohm_(motor.stator_resistance_ohm),
      rated_flux_vs_(motor.rated_flux_vs),
      motor_(inverse_gamma(motor, motor.rated_flux_vs)),
      flux_ratio_(motor_.leakage_inductance_h / motor.leakage_inductance_h),
      inertia_kg_m2_(inertia_kg_m2),
      rated_flux_current_a_(motor.rated_flux_vs /
                            (motor_.magnetizing_inductance_h + motor_.leakage_inductance_h)),
      voltage_limit_v_(config.voltage_use_ratio * dc_link_v / (2.0 * kHalfSqrt3)),
      weakening_1_h_(
          2.0 * motor_.rotor_resistance_ohm /
          (motor.rated_speed_rad_s * motor_.leakage_inductance_h * motor_.leakage_inductance_h)),
      slip_share_(lag_share(config.period_s, config.slip_filter_s)),
      damping_share_(lag_share(config.period_s, config.damping_filter_s)) {
  state_.flux_current_a = rated_flux_current_a_;
}

Complex Drive::step(const DriveInput& input) noexcept {
  const double reference = state_.reference.value(config_.speed_reference_rad_s, input.time_s);
  return config_.control == DriveControl::kVoltsPerHertz ? volts_per_hertz(input, reference)
                                                         : vector_control(input, reference);
}

Complex Drive::volts_per_hertz(const DriveInput& input, double reference) noexcept {
  State& s = state_;
  const double period_s = config_.period_s;
  const Complex current = input.current_a * conjugate(s.frame);
  // Slip from the current that makes torque, at assumed flux, (S20).
  const double slip = motor_.rotor_resistance_ohm * current.re /
                      (rated_flux_vs_ * motor_.magnetizing_inductance_h /
                       (motor_.magnetizing_inductance_h + motor_.leakage_inductance_h));
  s.slip_rad_s += slip_share_ * (slip - s.slip_rad_s);
  const Complex swing = current - s.mean_current_a;
  s.mean_current_a += damping_share_ * swing;

  const double wanted_rad_s = pole_pairs_ * reference;
  const bool turning = std::abs(wanted_rad_s) > 1e-6;
  const double supply_rad_s =
      turning ? wanted_rad_s + config_.slip_compensation_ratio * s.slip_rad_s : 0.0;
  // The frame lies along the voltage; the flux, rated_flux_vs_, 90 degrees behind it.
  Complex wanted{supply_rad_s * rated_flux_vs_, 0.0};  // (S19)
  const double boost_v =
      config_.resistance_compensation_ratio * resistance_ohm_ * rated_flux_current_a_;
  if (turning && boost_v > 0.0) {
    wanted.re += supply_rad_s < 0.0 ? -boost_v : boost_v;
  }
  wanted = wanted - config_.current_damping_ohm * swing;
  s.frame = s.frame * unit(supply_rad_s * period_s);
  s.frame = (1.0 / magnitude(s.frame)) * s.frame;  // rounding must not let it shrink
  return wanted * s.frame;
}

double Drive::torque_current_a(const DriveInput& input, double reference, double flux_vs) noexcept {
  State& s = state_;
  const double gain = config_.speed_bandwidth_rad_s * inertia_kg_m2_;
  const double error = reference - input.speed_rad_s;
  const double wanted_nm = gain * error - gain * input.speed_rad_s + s.torque_integral_nm;  // (S21)
  const double per_ampere = 1.5 * pole_pairs_ * flux_vs;
  if (!(flux_vs > 0.05 * rated_flux_vs_)) return 0.0;
  const double room =
      config_.current_limit_a * config_.current_limit_a - s.flux_current_a * s.flux_current_a;
  const double limit_a =
      std::min({std::sqrt(std::max(room, 0.0)), config_.torque_limit_nm / per_ampere,
                // Breakdown: beyond it more current gives less torque.
                flux_vs / motor_.leakage_inductance_h + s.flux_current_a});
  const double current_a = std::clamp(wanted_nm / per_ampere, -limit_a, limit_a);
  const double left_nm = current_a * per_ampere - wanted_nm;
  s.torque_integral_nm +=
      config_.period_s * config_.speed_bandwidth_rad_s * (gain * error + left_nm);  // (S22)
  return current_a;
}

void Drive::learn_from_realised() noexcept {
  State& s = state_;
  if (!s.running) return;
  const double gain = config_.current_bandwidth_rad_s * motor_.leakage_inductance_h;
  const Complex given = realised_v_ * conjugate(s.outward);
  s.current_integral_v += (config_.period_s * config_.current_bandwidth_rad_s) *
                          (gain * s.error_a + given - s.wanted_v);  // (S24)
  s.flux_current_a +=
      config_.period_s * weakening_1_h_ * (voltage_limit_v_ - magnitude(s.wanted_v));  // (S25)
  s.flux_current_a =
      std::clamp(s.flux_current_a, 0.05 * rated_flux_current_a_, rated_flux_current_a_);
}

Complex Drive::vector_control(const DriveInput& input, double reference) noexcept {
  State& s = state_;
  learn_from_realised();
  const double length = magnitude(input.rotor_flux_vs);
  const Complex axis = length > 1e-6 ? (1.0 / length) * input.rotor_flux_vs : Complex{1.0, 0.0};
  const double flux_vs = flux_ratio_ * length;
  const Complex current = input.current_a * conjugate(axis);
  const double torque_a = torque_current_a(input, reference, flux_vs);
  s.error_a = Complex{s.flux_current_a, torque_a} - current;

  const double slip =
      flux_vs > 0.05 * rated_flux_vs_ ? motor_.rotor_resistance_ohm * current.im / flux_vs : 0.0;
  s.frame_speed_rad_s = pole_pairs_ * input.speed_rad_s + slip;
  const double gain = config_.current_bandwidth_rad_s * motor_.leakage_inductance_h;
  // Proportional, active resistance, integral, and the cross coupling of the leakage, (S23).
  s.wanted_v = gain * s.error_a - gain * current + s.current_integral_v +
               (s.frame_speed_rad_s * motor_.leakage_inductance_h) * turned_left(current);
  // Applied one hold later, and held: on average the frame has then turned 1.5 periods, (S26).
  s.outward = axis * unit(1.5 * config_.period_s * s.frame_speed_rad_s);
  s.running = true;
  return s.wanted_v * s.outward;
}

}  // namespace cutforce::hal::host
