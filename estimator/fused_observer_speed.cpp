#include "estimator/fused_observer.hpp"
#include "estimator/polynomials.hpp"

// The fused observer's speeds: of the field, from flux and current, and of the shaft, measured or
// from the field and the slip.

namespace cutforce::estimator {
namespace {

constexpr float kTwoPi = 6.28318530718F;
constexpr float kFrequencyTime_s = 0.015F;
constexpr float kLowestFrequency_rad_s = kTwoPi * 3.0F;

// Turned angle; of the angles that look the same, the one nearest to what is expected.
float rotated(SpaceVector now, SpaceVector before, float expected_rad) noexcept {
  const float angle = angle_of(dot(now, before), cross(now, before));
  const float turns = (expected_rad - angle) / kTwoPi;
  return angle +
         kTwoPi * static_cast<float>(static_cast<int>(turns + (turns < 0.0F ? -0.5F : 0.5F)));
}

}  // namespace

auto FusedObserver::rotation(const FluxTorque::Window& window) noexcept -> Rotation {
  const float l = config_.leakage_inductance_h;
  const SpaceVector i = window.current_a;
  const SpaceVector rotor{window.flux_v_s.alpha - l * i.alpha, window.flux_v_s.beta - l * i.beta};
  const float expected = tick_.frequency_rad_s * window.duration_s;
  const Rotation result{
      .flux_rad_s = rotated(rotor, tick_.rotor_flux_v_s, expected) / window.duration_s,
      .current_rad_s = rotated(i, tick_.current_a, expected) / window.duration_s,
      .flux_squared = dot(rotor, rotor)};  // (E100)
  tick_.rotor_flux_v_s = rotor;
  tick_.current_a = i;
  return result;
}

void FusedObserver::track_frequency(const Rotation& r, float duration_s) noexcept {
  const float w = tick_.frequency_rad_s;
  const float size = magnitude(w);
  const float flux_floor = 0.3F * config_.rated_flux_v_s;
  // Until the offsets are taken out they turn the flux angle far more than the current's.
  const bool flux_agrees = tick_.calibrated != 0 && r.flux_squared > flux_floor * flux_floor &&
                           magnitude(r.flux_rad_s - w) < 0.3F * size + 20.0F &&
                           magnitude(r.current_rad_s - w) < 0.5F * size + 60.0F;
  const float seen = flux_agrees ? r.flux_rad_s : r.current_rad_s;
  if (duration_s != share_of_s_) {  // ticks are nearly always of one length
    share_of_s_ = duration_s;
    share_ = 1.0F - exp_bounded(-duration_s / kFrequencyTime_s);
  }
  const float share = share_;
  const float off = seen - w - tick_.acceleration_rad_s2 * duration_s;
  tick_.frequency_rad_s = seen - (1.0F - share) * off;  // (E101)
  tick_.acceleration_rad_s2 += 0.25F * share * share * off / duration_s;
  flux_.set_frequency(tick_.frequency_rad_s);

  const float now = magnitude(tick_.frequency_rad_s);
  const bool agrees = magnitude(r.current_rad_s - tick_.frequency_rad_s) < 0.3F * now + 20.0F;
  const bool was_locked = tick_.locked_s > 0.0F;
  if (now > kLowestFrequency_rad_s && (agrees || was_locked)) {
    if (!was_locked) flux_.seed();
    tick_.locked_s += duration_s;
  } else {
    tick_.locked_s = 0.0F;
  }
}

auto FusedObserver::take_speed(const Rotation& r, float torque_nm, bool locked,
                               float duration_s) noexcept -> Speed {
  const auto samples = static_cast<float>(tick_.speed_count);
  Speed speed{.mean_rad_s = samples > 0.0F ? tick_.speed_sum_rad_s / samples : 0.0F,
              .slip_rad_s = 0.0F,
              .samples = samples,
              .valid = samples > 0.0F};
  tick_.speed_sum_rad_s = 0.0F;
  tick_.speed_count = 0;
  if (!config_.sensorless) {
    if (!speed.valid) return speed;
    tick_.ripple_rad_s = ripple_.step(speed.mean_rad_s, duration_s);
    speed.mean_rad_s -= tick_.ripple_rad_s;
    return speed;
  }
  const float p = config_.flux.pole_pairs;
  speed.valid = locked && r.flux_squared > 0.0F;
  const float slip = speed.valid ? 2.0F * config_.resistance.rotor_resistance_ohm * torque_nm /
                                       (3.0F * p * r.flux_squared)
                                 : 0.0F;
  speed.slip_rad_s = slip;
  speed.mean_rad_s = (r.flux_rad_s - slip) / p;  // (E102)
  return speed;
}

}  // namespace cutforce::estimator
