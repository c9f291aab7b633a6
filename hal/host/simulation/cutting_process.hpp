// Turning with depth over position: a static force behind a first-order lag, P3 (10).
//   F_static = k_s a(x) h_0 (h/h_0)^p w(t) H(x) E(angle)          (S30)
//   tau_p dF/dt = F_static - F                                    (S31)
//   or, with depth_after_lag, F = a G, tau_p dG/dt = F_static/a - G
//   T_motor = F D(x)/2 / gear                                     (S32)
// a depth of cut [m], h feed per turn [m], h_0 the nominal one, w wear, H hard spots, E 0 or 1.
// A plain load torque over time may stand in its place or add to it.
#pragma once

#include <cstdint>
#include <vector>

#include "hal/host/simulation/profile.hpp"

namespace cutforce::hal::host {

struct HardSpot {
  double begin_m;
  double end_m;
  double factor;
};

struct ProcessConfig {
  double specific_force_n_m2 = 0.0;  // k_s; 0: no cutting process
  double nominal_feed_m_rev = 1.0;   // h_0
  double exponent = 1.0;             // p
  double lag_s = 0.0;                // tau_p
  bool depth_after_lag = false;      // P2: the slow pole is the drive's, depth acts at once
  Profile depth_m{0.0};              // over position
  Profile diameter_m{1.0};           // over position
  Profile wear_ratio{1.0};           // over time
  std::vector<HardSpot> hard_spots{};
  double slots_per_turn = 0.0;  // interrupted cut; 0: none
  double slot_ratio = 0.0;      // share of a pitch without material
  double slots_begin_m = 0.0;
  double slots_end_m = 0.0;
};

struct Oscillation {
  double begin_s;
  double end_s;
  double amplitude_nm;
  double frequency_hz;
};

struct LoadConfig {
  Profile torque_nm{0.0};  // cutting torque at the motor, over time
  std::vector<Oscillation> oscillations{};
};

// Friction that the cutting load causes, P3 (8): f(w) T_c + g(w) T_c^2.
struct LoadFrictionConfig {
  Profile ratio{0.0};        // f over |motor speed|
  Profile per_nm_1_nm{0.0};  // g over |motor speed|
};

struct ProcessInput {
  double time_s;
  double position_m;
  double feed_m_s;
  double spindle_turns_s;
  double spindle_turns;  // angle
  double motor_speed_rad_s;
};

class CuttingProcess {
 public:
  struct State {
    double force_n = 0.0;
    double depth_m = 0.0;
    double diameter_m = 0.0;
    double cutting_torque_nm = 0.0;  // at the motor
    double load_torque_nm = 0.0;     // with the friction it causes, (S33)
  };

  CuttingProcess(const ProcessConfig& process, const LoadConfig& load,
                 const LoadFrictionConfig& friction, double gear_ratio, double period_s);
  void step(const ProcessInput& input) noexcept;
  [[nodiscard]] const State& state() const noexcept { return state_; }
  // Without lag and without rotation: what the force tends to.
  [[nodiscard]] double static_force_n(const ProcessInput& input) noexcept;
  // As if feed and cut had been these for long.
  void settle(const ProcessInput& input) noexcept;

 private:
  [[nodiscard]] double force_at_depth_n(double depth_m, const ProcessInput& input) noexcept;
  [[nodiscard]] double plain_load_nm(double time_s) noexcept;

  ProcessConfig process_;
  LoadConfig load_;
  LoadFrictionConfig friction_;
  double gear_ratio_;
  double lag_share_;
  double per_depth_n_m_ = 0.0;  // lagged, of depth_after_lag
  ProfileCursor depth_, diameter_, wear_, torque_, ratio_, per_nm_;
  State state_;
};

}  // namespace cutforce::hal::host
