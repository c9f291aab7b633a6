// The drive's own control: volts per hertz, or field orientation with speed and current
// controllers. It runs once a hold; what it computes now is applied in the next hold, as a real
// digital drive does. Equations (S19)-(S26).
// Assumption: the vector drive knows rotor flux and speed of its motor without error. How well a
// drive orients itself is not what this project estimates; the signals at its terminals are.
#pragma once

#include <cstdint>

#include "hal/host/simulation/complex.hpp"
#include "hal/host/simulation/induction_motor.hpp"
#include "hal/host/simulation/profile.hpp"

namespace cutforce::hal::host {

enum class DriveControl : std::uint8_t { kVoltsPerHertz, kVector };

struct DriveConfig {
  DriveControl control;
  double period_s;                // of control, and length of a hold
  Profile speed_reference_rad_s;  // motor shaft, over time
  // Volts per hertz.
  double resistance_compensation_ratio = 0.0;  // of R_s i_0, at and near standstill
  double slip_compensation_ratio = 0.0;        // 1: speed kept under load
  double slip_filter_s = 0.1;
  double current_damping_ohm = 0.0;
  double damping_filter_s = 0.05;
  // Vector.
  double speed_bandwidth_rad_s = 0.0;
  double current_bandwidth_rad_s = 0.0;
  double torque_limit_nm = 0.0;
  double current_limit_a = 0.0;     // peak
  double voltage_use_ratio = 0.95;  // share of the linear range before field weakening
};

struct DriveInput {
  double time_s;
  Complex current_a;
  Complex rotor_flux_vs;  // Gamma
  double speed_rad_s;
};

class Drive {
 public:
  Drive(const DriveConfig& config, const MotorConfig& motor, double inertia_kg_m2,
        double dc_link_v) noexcept;

  // Wanted voltage for the hold after the one that begins now. `realised_v` tells the drive at the
  // next call how much of it the inverter gave: that keeps its integrators from winding up.
  [[nodiscard]] Complex step(const DriveInput& input) noexcept;
  void realised(Complex voltage_v) noexcept { realised_v_ = voltage_v; }

 private:
  struct State {
    ProfileCursor reference;
    // Volts per hertz: unit vector of the voltage frame, filtered current and slip.
    Complex frame{1.0, 0.0};
    Complex mean_current_a;
    double slip_rad_s = 0.0;
    // Vector: integrators of speed and current, flux-producing current.
    double torque_integral_nm = 0.0;
    Complex current_integral_v;
    double flux_current_a = 0.0;
    double frame_speed_rad_s = 0.0;
    Complex wanted_v;  // last, rotor-flux frame
    Complex error_a;
    Complex outward;  // from the rotor-flux frame to the stator, as used for wanted_v
    bool running = false;
  };
  [[nodiscard]] Complex volts_per_hertz(const DriveInput& input, double reference) noexcept;
  [[nodiscard]] Complex vector_control(const DriveInput& input, double reference) noexcept;
  [[nodiscard]] double torque_current_a(const DriveInput& input, double reference,
                                        double flux_vs) noexcept;
  void learn_from_realised() noexcept;

  DriveConfig config_;
  double pole_pairs_;
  double resistance_ohm_;
  double rated_flux_vs_;  // stator
  InverseGamma motor_;    // at rated flux
  double flux_ratio_;     // rotor flux, inverse-Gamma over Gamma
  double inertia_kg_m2_;
  double rated_flux_current_a_;
  double voltage_limit_v_;
  double weakening_1_h_;
  double slip_share_;
  double damping_share_;
  State state_;
  Complex realised_v_{};
};

}  // namespace cutforce::hal::host
