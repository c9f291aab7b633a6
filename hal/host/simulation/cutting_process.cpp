#include "hal/host/simulation/cutting_process.hpp"

#include <algorithm>
#include <cmath>

#include "hal/host/simulation/arithmetic.hpp"

namespace cutforce::hal::host {
namespace {

// Below this the chip thickness v/n has no meaning, and a tool that rubs cuts nothing.
constexpr double kLeastTurnsS = 0.1;

double share_of(double x) noexcept { return x - std::floor(x); }

}  // namespace

CuttingProcess::CuttingProcess(const ProcessConfig& process, const LoadConfig& load,
                               const LoadFrictionConfig& friction, double gear_ratio,
                               double period_s)
    : process_(process),
      load_(load),
      friction_(friction),
      gear_ratio_(gear_ratio),
      lag_share_(lag_share(period_s, process.lag_s)) {}

double CuttingProcess::force_at_depth_n(double depth_m, const ProcessInput& input) noexcept {
  const ProcessConfig& p = process_;
  const double turns_s = std::abs(input.spindle_turns_s);
  if (!(depth_m > 0.0) || turns_s < kLeastTurnsS || !(input.feed_m_s > 0.0)) return 0.0;
  const double relative = input.feed_m_s / turns_s / p.nominal_feed_m_rev;
  double force_n = p.specific_force_n_m2 * depth_m * p.nominal_feed_m_rev *
                   (p.exponent == 1.0 ? relative : power(relative, p.exponent)) *
                   wear_.value(p.wear_ratio, input.time_s);  // (S30)
  for (const HardSpot& spot : p.hard_spots) {
    if (input.position_m >= spot.begin_m && input.position_m < spot.end_m) force_n *= spot.factor;
  }
  if (p.slots_per_turn > 0.0 && input.position_m >= p.slots_begin_m &&
      input.position_m < p.slots_end_m &&
      share_of(input.spindle_turns * p.slots_per_turn) < p.slot_ratio) {
    force_n = 0.0;
  }
  return force_n;
}

double CuttingProcess::static_force_n(const ProcessInput& input) noexcept {
  state_.depth_m = depth_.value(process_.depth_m, input.position_m);
  return force_at_depth_n(state_.depth_m, input);
}

void CuttingProcess::settle(const ProcessInput& input) noexcept {
  state_.force_n = static_force_n(input);
  per_depth_n_m_ = force_at_depth_n(1.0, input);
}

double CuttingProcess::plain_load_nm(double time_s) noexcept {
  double torque_nm = torque_.value(load_.torque_nm, time_s);
  for (const Oscillation& o : load_.oscillations) {
    if (time_s < o.begin_s || time_s >= o.end_s) continue;
    torque_nm += o.amplitude_nm * sine_cosine(kTwoPi * o.frequency_hz * (time_s - o.begin_s)).sine;
  }
  return torque_nm;
}

void CuttingProcess::step(const ProcessInput& input) noexcept {
  double torque_nm = plain_load_nm(input.time_s);
  state_.diameter_m = diameter_.value(process_.diameter_m, input.position_m);
  if (process_.specific_force_n_m2 > 0.0) {
    if (process_.depth_after_lag) {
      state_.depth_m = depth_.value(process_.depth_m, input.position_m);
      per_depth_n_m_ = lagged(per_depth_n_m_, force_at_depth_n(1.0, input), lag_share_);
      state_.force_n = state_.depth_m * per_depth_n_m_;
    } else {
      state_.force_n = lagged(state_.force_n, static_force_n(input), lag_share_);  // (S31)
    }
    torque_nm += state_.force_n * 0.5 * state_.diameter_m / gear_ratio_;  // (S32)
  } else {
    state_.force_n = torque_nm * gear_ratio_ / (0.5 * state_.diameter_m);
  }
  // Cutting resists the rotation that there is; it drives nothing backwards.
  state_.cutting_torque_nm = torque_nm * hyperbolic_tangent(input.motor_speed_rad_s);
  const double size_nm = std::abs(state_.cutting_torque_nm);
  const double speed_rad_s = std::abs(input.motor_speed_rad_s);
  state_.load_torque_nm =
      state_.cutting_torque_nm * (1.0 + ratio_.value(friction_.ratio, speed_rad_s) +
                                  per_nm_.value(friction_.per_nm_1_nm, speed_rad_s) * size_nm);
}

}  // namespace cutforce::hal::host
