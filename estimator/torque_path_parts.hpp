// What TorquePath's two sources share and nobody else needs.
#pragma once

#include "estimator/torque_path.hpp"

namespace cutforce::estimator {

struct TorquePath::Window {
  float airgap_power_w;
  float current_square_a2;
  float noise_variance_w2;
  float measured_power_w;
  float measured_sigma_w;
  float direction;          // +1 or -1
  float speed_rad_s;        // rotor, mean
  float end_speed_rad_s;    // rotor, at the end of the window
  float power_speed_rad_s;  // that power is divided by
  bool has_airgap_power;
  bool has_measured_power;
  bool has_speed;
  bool has_sensor;
};

struct TorquePath::Estimate {
  float airgap_torque_nm;
  float cutting_torque_nm;
  float sensitivity_ratio;
  float noise_variance_nm2;  // of airgap_torque_nm, from what this estimate alone rests on
  float model_variance_nm2;
};

struct TorquePath::Load {
  IdleTare::Output tare;
  float inertia_torque_nm;
  float not_cutting_nm;  // what stands between air-gap torque and torque above idle
};

}  // namespace cutforce::estimator
