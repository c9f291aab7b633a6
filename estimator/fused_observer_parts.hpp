// The fused observer's tick in its parts, inlined where they are used once: handed over in
// registers, they take half the instructions. For fused_observer.cpp only.
#pragma once

#include <cmath>

#include "estimator/fused_observer.hpp"
#include "estimator/polynomials.hpp"

namespace cutforce::estimator {

inline constexpr float kPi = 3.14159265358979F;
inline constexpr float kTwoPi = 6.28318530718F;
inline constexpr float kLock_s = 0.03F;
inline constexpr float kLate_ticks = 0.7F;
inline constexpr float kFading_ratio = 0.8F;
inline constexpr float kConsistencyShare = 0.02F;
inline constexpr float kTareFollow_ratio = 0.02F;  // of what the tare belongs to, each tick

// Turned angle; of the angles that look the same, the one nearest to what is expected.
[[gnu::always_inline]] inline float rotated(SpaceVector now, SpaceVector before,
                                            float expected_rad) noexcept {
  const float angle = angle_of(dot(now, before), cross(now, before));
  const float off = expected_rad - angle;
  if (magnitude(off) < kPi) [[likely]]
    return angle;
  const float turns = off / kTwoPi;
  return angle +
         kTwoPi * static_cast<float>(static_cast<int>(turns + (turns < 0.0F ? -0.5F : 0.5F)));
}

[[gnu::always_inline]] inline auto FusedObserver::rotation(
    const FluxTorque::Window& window) noexcept -> Rotation {
  constexpr float kFlux_rad_s = 20.0F;
  constexpr float kCurrent_rad_s = 60.0F;
  const float l = settings_.leakage_inductance_h;
  const float h = length_.tick_s;
  const SpaceVector i = window.current_a;
  const SpaceVector rotor{window.flux_v_s.alpha - l * i.alpha, window.flux_v_s.beta - l * i.beta};
  const float expected = tick_.frequency_rad_s * h;
  const float size = magnitude(expected);
  const float flux_squared = dot(rotor, rotor);
  const float flux_rad = rotated(rotor, tick_.rotor_flux_v_s, expected);  // (E100)
  const float current_rad = rotated(i, tick_.current_a, expected);
  // Until the offsets are taken out they turn the flux angle far more than the current's.
  const bool by_flux = tick_.calibrated != 0 && flux_squared > settings_.least_flux_squared &&
                       magnitude(flux_rad - expected) < 0.3F * size + kFlux_rad_s * h &&
                       magnitude(current_rad - expected) < 0.5F * size + kCurrent_rad_s * h;
  tick_.rotor_flux_v_s = rotor;
  tick_.current_a = i;
  return {.seen_rad = by_flux ? flux_rad : current_rad,
          .current_rad = current_rad,
          .flux_rad_s = flux_rad * length_.ticks_per_s,
          .flux_squared = flux_squared};
}

[[gnu::always_inline]] inline void FusedObserver::track_frequency(const Rotation& r) noexcept {
  constexpr float kLowestFrequency_rad_s = kTwoPi * 3.0F;
  const float h = length_.tick_s;
  const float seen = r.seen_rad * length_.ticks_per_s;
  const float off = seen - tick_.frequency_rad_s - tick_.acceleration_rad_s2 * h;
  const float frequency = seen - length_.keep * off;  // (E101)
  tick_.frequency_rad_s = frequency;
  tick_.acceleration_rad_s2 += length_.acceleration_1_s2 * off;
  flux_.set_frequency(frequency);
  if (magnitude(frequency) > kLowestFrequency_rad_s &&
      (tick_.locked_s > 0.0F || locks(r.current_rad))) {
    tick_.locked_s += h;
  } else {
    tick_.locked_s = 0.0F;
  }
}

[[gnu::always_inline]] inline auto FusedObserver::take_speed(const Rotation& r,
                                                             float torque_nm) noexcept -> Speed {
  const auto samples = static_cast<float>(tick_.speed_count);
  Speed speed{.mean_rad_s = 0.0F, .slip_rad_s = 0.0F, .samples = samples, .valid = samples > 0.0F};
  if (speed.valid) speed.mean_rad_s = tick_.speed_sum_rad_s / samples;
  tick_.speed_sum_rad_s = 0.0F;
  tick_.speed_count = 0;
  if (settings_.sensorless == 0) {
    if (!speed.valid) return speed;
    tick_.ripple_rad_s = ripple_.step(speed.mean_rad_s, length_.tick_s);
    speed.mean_rad_s -= tick_.ripple_rad_s;
    return speed;
  }
  speed.valid = tick_.locked_s > kLock_s && r.flux_squared > 0.0F;
  if (speed.valid) speed.slip_rad_s = settings_.slip_ohm * torque_nm / r.flux_squared;
  speed.mean_rad_s = (r.flux_rad_s - speed.slip_rad_s) / settings_.pole_pairs;  // (E102)
  return speed;
}

[[gnu::always_inline]] inline auto FusedObserver::corrected(
    const FluxTorque::Window& window) const noexcept -> Torque {
  const float per_power = settings_.pole_pairs / tick_.frequency_rad_s;
  const float copper = 1.5F * window.current_squared_a2 * per_power;
  const float by_power = window.power_w * per_power;
  return {.copper = copper,
          .by_power = by_power,
          .mean_nm = window.torque_nm +
                     meter_.excess_ratio() * (by_power - tick_.idle_power_torque_nm) -  // (E122)
                     resistance_.change_ohm() * (copper - tick_.idle_copper),           // (E111)
          .moment_nm = window.moment_nm};
}

[[gnu::always_inline]] inline auto FusedObserver::noise(const Speed& speed,
                                                        bool by_angle) const noexcept
    -> LoadTorqueFilter::Noise {
  LoadTorqueFilter::Noise noise = noise_.noise();
  noise.centre_ratio = 0.5F;
  if (!by_angle) noise.centre_ratio -= 0.5F / (speed.samples > 1.0F ? speed.samples : 1.0F);
  if (settings_.sensorless != 0) noise.torque_variance *= 4.0F;
  return noise;
}

[[gnu::always_inline]] inline void FusedObserver::note_even(bool steady,
                                                            float turned_rad) noexcept {
  if (steady) [[likely]] {
    tick_.even_angle_rad += turned_rad;
    tick_.even_s += length_.tick_s;
  } else {
    tick_.even_angle_rad = tick_.even_s = 0.0F;
  }
}

[[gnu::always_inline]] inline float FusedObserver::sigma_nm(const LoadTorqueFilter::Output& load,
                                                            const AirCut::Output& air,
                                                            const Torque& torque,
                                                            float change_nm) noexcept {
  const float scale = 0.003F * air.net_torque_nm;
  const float inertia = inertia_.sigma_ratio() * (torque.mean_nm - load.load_torque_nm);
  const float found_ohm = resistance_.change_sigma_ohm();
  const float resistance = (found_ohm < settings_.usual_ohm ? found_ohm : settings_.usual_ohm) *
                           (torque.copper - tick_.idle_copper);
  const float fading = kFading_ratio * tick_.moved_nm;
  const float size = magnitude(change_nm);
  tick_.moved_nm = size > fading ? size : fading;
  const float moved = kLate_ticks * tick_.moved_nm;
  // Innovations larger than expected: the load moves in a way that neither model knows.
  tick_.consistency_ratio += kConsistencyShare * (load.consistency_ratio - tick_.consistency_ratio);
  float noise = load.variance_nm2;
  if (tick_.consistency_ratio > 1.0F) noise *= tick_.consistency_ratio;
  if (noise < air.idle_variance_nm2) noise = air.idle_variance_nm2;
  return std::sqrt(noise + settings_.model_variance_nm2 + scale * scale + inertia * inertia +
                   resistance * resistance + moved * moved + air.tare_variance_nm2);  // (E104)
}

[[gnu::always_inline]] inline void FusedObserver::learn(const FluxTorque::Window& window,
                                                        const Rotation& r, const Torque& torque,
                                                        const AirCut::Output& air,
                                                        float speed_rad_s) noexcept {
  if (air.phase == AirCut::Phase::kIdle) {
    const float share = air.idle_s <= length_.tick_s ? 1.0F : kTareFollow_ratio;
    tick_.idle_copper += share * (torque.copper - tick_.idle_copper);
    tick_.idle_power_torque_nm += share * (torque.by_power - tick_.idle_power_torque_nm);
  }
  if (tick_.has_meter != 0) {
    meter_.step(window.power_w, tick_.meter_w, length_.tick_s);
    tick_.has_meter = 0;
  }
  if (settings_.tracks_resistance == 0) return;
  if (resistance_.stands_out(tick_.idle_copper, tick_.frequency_rad_s)) {
    learn_resistance(window, r.flux_rad_s, speed_rad_s);
  } else {
    resistance_.pause();
  }
}

}  // namespace cutforce::estimator
