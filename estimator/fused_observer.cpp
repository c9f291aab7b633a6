#include "estimator/fused_observer.hpp"

#include <cmath>

#include "estimator/fused_observer_parts.hpp"
#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kFrequencyTime_s = 0.015F;
constexpr float kInertiaWait_s = 0.1F;       // after the lock: the flux has settled
constexpr float kRippleWait_s = 0.2F;        // until a transient has gone from the rest
constexpr float kRippleSpeed_rad_s = 60.0F;  // slower, a turn is no quicker than a drift
constexpr float kAveragedTare_s = 0.05F;
constexpr float kEvenTurns = 1.5F;
constexpr float kUncalibrated_ratio = 0.03F;

}  // namespace

auto FusedObserver::state() const noexcept -> State {
  return {.flux = flux_.state(),
          .filter = filter_.state(),
          .air = air_.state(),
          .noise = noise_.state(),
          .ripple = ripple_.state(),
          .inertia = inertia_.state(),
          .resistance = resistance_.state(),
          .meter = meter_.state(),
          .tick = tick_,
          .delayed_nm = delayed_nm_};
}

void FusedObserver::restore(const State& state) noexcept {
  flux_.restore(state.flux);
  filter_.restore(state.filter);
  air_.restore(state.air);
  noise_.restore(state.noise);
  ripple_.restore(state.ripple);
  inertia_.restore(state.inertia);
  resistance_.restore(state.resistance);
  meter_.restore(state.meter);
  tick_ = state.tick;
  delayed_nm_ = state.delayed_nm;
}

void FusedObserver::recalibrated(SpaceVector voltage_offset_v,
                                 SpaceVector current_offset_a) noexcept {
  flux_.remove_offset(voltage_offset_v, current_offset_a);
  const SpaceVector psi = flux_.state().flux_v_s;
  const SpaceVector i = flux_.state().current_a;
  const float l = settings_.leakage_inductance_h;
  tick_.rotor_flux_v_s = {psi.alpha - l * i.alpha, psi.beta - l * i.beta};
  tick_.current_a = i;
  if (tick_.calibrated != 0) return;  // a refinement: too small to upset what runs
  // What the filter has seen so far carries the ripple of the offsets: begin anew from the means.
  const LoadTorqueFilter::Noise& noise = noise_.noise();
  // A measured speed never carried it; the flux's did.
  filter_.start(
      settings_.sensorless != 0 ? noise_.explained_speed_rad_s() : noise_.last_speed_rad_s(),
      std::sqrt(noise.speed_variance + 2.0F * noise.angle_variance), noise_.mean_torque_nm(),
      kUncalibrated_ratio * settings_.rated_torque_nm);
  noise_.restart();
  air_.restart_average();
  tick_.calibrated = 1;
}

void FusedObserver::restart() noexcept {
  FluxTorque::State flux{};
  flux.leak = flux_.state().leak;
  flux.gain_s = flux_.state().gain_s;
  flux.frequency_rad_s = flux_.state().frequency_rad_s;
  flux_.restore(flux);
  tick_.locked_s = 0.0F;
  tick_.acceleration_rad_s2 = 0.0F;
  tick_.speed_sum_rad_s = 0.0F;
  tick_.speed_count = 0;
  tick_.ticks = 0;
  noise_.restart();
  ripple_.forget();
}

[[gnu::noinline]] void FusedObserver::renew_length(float tick_s) noexcept {
  const float share = 1.0F - exp_bounded(-tick_s / kFrequencyTime_s);
  length_ = {.tick_s = tick_s,
             .ticks_per_s = 1.0F / tick_s,
             .keep = 1.0F - share,
             .acceleration_1_s2 = 0.25F * share * share / tick_s};
}

// Not locked: at what the current turns by first, it must agree.
[[gnu::noinline]] bool FusedObserver::locks(float current_rad) noexcept {
  const float frequency = tick_.frequency_rad_s;
  const float seen = current_rad * length_.ticks_per_s;
  if (!(magnitude(seen - frequency) < 0.3F * magnitude(frequency) + 20.0F)) return false;
  flux_.seed();
  return true;
}

[[gnu::noinline]] auto FusedObserver::unlocked(const FluxTorque::Window& window, float speed_rad_s,
                                               AirCut::Feed feed) noexcept -> Output {
  tick_.ticks = 0;
  noise_.restart();
  ripple_.forget();
  static_cast<void>(air_.step({.load_torque_nm = 0.0F,
                               .sigma_nm = 0.0F,
                               .model_sigma_nm = 0.0F,
                               .airgap_torque_nm = 0.0F,
                               .speed_rad_s = speed_rad_s,
                               .speed_sigma_rad_s = 0.0F,
                               .duration_s = window.duration_s,
                               .feed = feed,
                               .calibrated = tick_.calibrated != 0,
                               .valid = false}));
  inertia_.lose();
  Output out{};
  out.phase = AirCut::Phase::kUnsteady;
  out.airgap_power_w = airgap_power_w(window);
  out.airgap_torque_nm = window.torque_nm;
  out.speed_rad_s = speed_rad_s;
  out.frequency_rad_s = tick_.frequency_rad_s;
  out.duration_s = window.duration_s;
  return out;
}

[[gnu::noinline]] void FusedObserver::learn_ripple(const AirCut::Output& air,
                                                   float speed_rad_s) noexcept {
  // Before the first tare a ripple may be what keeps the torque from being known well enough.
  const bool idle = air.phase == AirCut::Phase::kIdle;
  const bool even = air.steady && tick_.calibrated != 0 && !air.has_tare;
  if ((idle || even) && noise_.follows_speed(idle) && tick_.even_s > kRippleWait_s &&
      magnitude(speed_rad_s) > kRippleSpeed_rad_s && settings_.sensorless == 0) {
    ripple_.learn(noise_.rest_rad_s() + tick_.ripple_rad_s, length_.tick_s);
  }
}

[[gnu::noinline]] void FusedObserver::learn_resistance(const FluxTorque::Window& window,
                                                       float flux_rad_s,
                                                       float speed_rad_s) noexcept {
  // |psi_R|^2 with the resistance found so far: psi less dR i / (j w_e).
  const float k = resistance_.change_ohm() / tick_.frequency_rad_s;
  const SpaceVector rotor{tick_.rotor_flux_v_s.alpha - k * window.current_a.beta,
                          tick_.rotor_flux_v_s.beta + k * window.current_a.alpha};
  resistance_.step({.flux_squared = dot(rotor, rotor),
                    .flux_frequency_rad_s = flux_rad_s,
                    .speed_rad_s = speed_rad_s,
                    .frequency_rad_s = tick_.frequency_rad_s,
                    .torque_nm = window.torque_nm,
                    .current_squared_a2 = window.current_squared_a2,
                    .idle_copper_nm_ohm = tick_.idle_copper,
                    .duration_s = length_.tick_s,
                    .steady = tick_.even_s > 0.0F && tick_.calibrated != 0});
}

[[gnu::noinline]] void FusedObserver::delay(Torque& torque) noexcept {
  constexpr std::uint32_t kSize = kLongestDelay + 1;
  if (tick_.ticks == 0) {
    for (std::uint32_t k = 0; k < kSize; ++k) {
      delayed_nm_[2 * k] = torque.mean_nm;
      delayed_nm_[2 * k + 1] = torque.moment_nm;
    }
  }
  const std::uint32_t now = 2 * (tick_.ticks % kSize);
  delayed_nm_[now] = torque.mean_nm;
  delayed_nm_[now + 1] = torque.moment_nm;
  const std::uint32_t then = 2 * ((tick_.ticks + kSize - settings_.speed_delay_ticks) % kSize);
  torque.mean_nm = delayed_nm_[then];
  torque.moment_nm = delayed_nm_[then + 1];
}

auto FusedObserver::tick(AirCut::Feed feed) noexcept -> Output {
  const FluxTorque::Window window = flux_.take();
  const float h = window.duration_s;
  if (!(h > 0.0F)) [[unlikely]]
    return Output{};
  if (h != length_.tick_s) [[unlikely]]
    renew_length(h);
  const Rotation r = rotation(window);
  track_frequency(r);
  const Speed speed = take_speed(r, window.torque_nm);
  if (!(tick_.locked_s > kLock_s) || (!speed.valid && tick_.ticks == 0)) [[unlikely]]
    return unlocked(window, speed.mean_rad_s, feed);

  const bool calibrated = tick_.calibrated != 0;
  const bool sensorless = settings_.sensorless != 0;
  const Torque torque = corrected(window);
  Torque waited = torque;
  const bool by_angle = noise_.counts() || sensorless;
  if (by_angle)
    waited.moment_nm += 0.5F * window.torque_nm * settings_.sample_period_s * length_.ticks_per_s;
  if (settings_.speed_delay_ticks != 0) [[unlikely]]
    delay(waited);
  if (tick_.ticks == 0) [[unlikely]]
    filter_.start(speed.mean_rad_s, 1.0F, torque.mean_nm, settings_.rated_torque_nm);
  ++tick_.ticks;

  const LoadTorqueFilter::Noise noise = this->noise(speed, by_angle);
  const LoadTorqueFilter::Output load = filter_.step({.torque_nm = waited.mean_nm,
                                                      .moment_nm = waited.moment_nm,
                                                      .speed_rad_s = speed.mean_rad_s,
                                                      .duration_s = h,
                                                      .inertia_kg_m2 = inertia_.inertia_kg_m2(),
                                                      .speed_valid = speed.valid},
                                                     noise);
  const float change = load.load_torque_nm - tick_.load_torque_nm;
  tick_.load_torque_nm = load.load_torque_nm;
  // The field's own speed is calmer than what the flux says of the shaft's.
  const float air_rad_s = sensorless
                              ? (tick_.frequency_rad_s - speed.slip_rad_s) / settings_.pole_pairs
                              : load.speed_rad_s;
  const AirCut::Output air =
      air_.step({.load_torque_nm = load.load_torque_nm,
                 .sigma_nm = std::sqrt(load.variance_nm2),
                 .model_sigma_nm = magnitude(resistance_.change_sigma_ohm() * torque.copper),
                 .airgap_torque_nm = torque.mean_nm,
                 .speed_rad_s = air_rad_s,
                 .speed_sigma_rad_s = std::sqrt(noise.speed_variance + 2.0F * noise.angle_variance),
                 .duration_s = h,
                 .feed = feed,
                 .calibrated = calibrated,
                 .valid = true});
  const bool idle = air.phase == AirCut::Phase::kIdle;
  if (speed.valid) [[likely]] {
    noise_.step({.torque_nm = waited.mean_nm,
                 .moment_nm = waited.moment_nm,
                 .speed_rad_s = speed.mean_rad_s,
                 .duration_s = h,
                 .inertia_kg_m2 = inertia_.inertia_kg_m2(),
                 .idle = idle,
                 .calibrated = calibrated});
    if (idle || !air.has_tare) learn_ripple(AirCut::Output{air}, speed.mean_rad_s);
  }
  inertia_.step({.torque_nm = window.torque_nm,
                 .speed_rad_s = load.speed_rad_s,
                 .duration_s = h,
                 .valid = tick_.locked_s > kLock_s + kInertiaWait_s,
                 .idle = idle && air.idle_s > kAveragedTare_s,
                 .in_cut = air.phase == AirCut::Phase::kCut,
                 .tare_nm = load.speed_rad_s < 0.0F ? -air.tare_nm : air.tare_nm,
                 .calibrated = calibrated});
  note_even(air.steady, r.current_rad);
  const float sigma = sigma_nm(load, air, torque, change);
  learn(window, r, torque, air, speed.mean_rad_s);
  // Channel offsets ripple the angle once a turn of the field: only the mean of turns counts.
  const bool even_turns = magnitude(tick_.even_angle_rad) > kEvenTurns * kTwoPi;
  return {.valid = true,
          .calibrated = calibrated,
          .tared = air.has_tare,
          .phase = air.phase,
          .airgap_power_w = airgap_power_w(window),
          .airgap_torque_nm = torque.mean_nm,
          .load_torque_nm = load.load_torque_nm,
          .net_torque_nm = air.net_torque_nm,
          .net_sigma_nm = sigma,
          .speed_rad_s = load.speed_rad_s,
          .frequency_rad_s = tick_.frequency_rad_s,
          .even_frequency_rad_s = even_turns ? tick_.even_angle_rad / tick_.even_s : 0.0F,
          .tare_nm = air.tare_nm,
          .tare_age_s = air.tare_age_s,
          .idle_s = air.idle_s,
          .duration_s = h};
}

}  // namespace cutforce::estimator
