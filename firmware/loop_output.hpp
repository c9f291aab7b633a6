// What the control loop publishes, once an estimate period: one row of a trace.
#pragma once

#include <cstdint>

#include "estimator/fault.hpp"

namespace cutforce::firmware {

// Which estimate fed the output.
enum class Source : std::uint8_t { kNone, kMeasured, kComputed, kFused, kDynamometer };

enum class LoopState : std::uint8_t {
  kStarting,    // not enough signal yet
  kNoEstimate,  // below the minimum speed, or the force cannot be told
  kAir,         // turning, not cutting: idle calibration and tare
  kCut,
  kRefused,  // the signals cannot carry an estimate; fault says why
};

struct LoopOutput {
  enum Value : std::uint32_t {
    kAirGapPower = 1U << 0,
    kMeasuredPower = 1U << 1,
    kAirGapTorque = 1U << 2,
    kLoadTorque = 1U << 3,
    kCuttingTorque = 1U << 4,  // with its sigma
    kCuttingForce = 1U << 5,   // with its sigma
    kOverride = 1U << 6,
    kProcessGain = 1U << 7,  // with its sigma
    kStabilityMargin = 1U << 8,
  };

  std::int64_t time_ns;  // end of the window that the row describes
  float airgap_power_w;
  float measured_power_w;
  float airgap_torque_nm;   // before inertia and friction
  float load_torque_nm;     // after inertia: all that loads the motor
  float cutting_torque_nm;  // after friction, at the motor
  float cutting_torque_sigma_nm;
  float cutting_force_n;
  float cutting_force_sigma_n;
  float override_pct;
  // What the law in charge knows of the process; not in a trace, whose columns are fixed.
  float process_gain_n_pct;        // force over override, static
  float process_gain_sigma_ratio;  // standard deviation of that, relative
  float stability_margin_ratio;    // the process gain may be this many times the estimated one
  std::uint32_t present;           // Value bits; what is not there has value 0
  estimator::FaultSet faults;
  Source source;
  LoopState state;
  bool control_tick;    // the row ends a control period: override_pct is new
  bool doubtful;        // the force is to be seen, not to be acted on: faults says why
  bool saturated_low;   // controlling, and the floor acts, since the last control tick
  bool saturated_high;  // controlling, and the ceiling acts
};

}  // namespace cutforce::firmware
