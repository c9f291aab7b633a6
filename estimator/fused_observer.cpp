#include "estimator/fused_observer.hpp"

#include <cmath>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kTwoPi = 6.28318530718F;
constexpr float kLock_s = 0.03F;
constexpr float kInertiaWait_s = 0.1F;          // after the lock: the flux has settled
constexpr float kRippleWait_s = 0.2F;           // until a transient has gone from the rest
constexpr float kRippleSpeed_rad_s = 60.0F;     // slower, a turn is no quicker than a drift
constexpr float kUsualResistance_ratio = 0.1F;  // what temperature does to copper, one sigma
constexpr float kLate_ticks = 0.7F;
constexpr float kFading_ratio = 0.8F;
constexpr float kConsistencyShare = 0.02F;
constexpr float kAveragedTare_s = 0.05F;
constexpr float kEvenTurns = 1.5F;
constexpr float kUncalibrated_ratio = 0.03F;
constexpr float kTareFollow_ratio = 0.02F;  // of what the tare belongs to, each tick

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
          .tick = tick_};
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
}

void FusedObserver::recalibrated(SpaceVector voltage_offset_v,
                                 SpaceVector current_offset_a) noexcept {
  flux_.remove_offset(voltage_offset_v, current_offset_a);
  const SpaceVector psi = flux_.state().flux_v_s;
  const SpaceVector i = flux_.state().current_a;
  const float l = config_.leakage_inductance_h;
  tick_.rotor_flux_v_s = {psi.alpha - l * i.alpha, psi.beta - l * i.beta};
  tick_.current_a = i;
  if (tick_.calibrated != 0) return;  // a refinement: too small to upset what runs
  // What the filter has seen so far carries the ripple of the offsets: begin anew from the means.
  const LoadTorqueFilter::Noise& noise = noise_.noise();
  // A measured speed never carried it; the flux's did.
  filter_.start(config_.sensorless ? noise_.explained_speed_rad_s() : noise_.last_speed_rad_s(),
                std::sqrt(noise.speed_variance + 2.0F * noise.angle_variance),
                noise_.mean_torque_nm(), kUncalibrated_ratio * config_.filter.rated_torque_nm);
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

float FusedObserver::correction_nm(const FluxTorque::Window& window, float copper) const noexcept {
  const float by_power =
      window.power_w * config_.flux.pole_pairs / tick_.frequency_rad_s - tick_.idle_power_torque_nm;
  return (meter_.gain_ratio() - 1.0F) * by_power -
         resistance_.change_ohm() * (copper - tick_.idle_copper);
}

auto FusedObserver::unlocked(float speed_rad_s, AirCut::Feed feed, Output out) noexcept -> Output {
  tick_.ticks = 0;
  noise_.restart();
  ripple_.forget();
  static_cast<void>(air_.step({.load_torque_nm = 0.0F,
                               .sigma_nm = 0.0F,
                               .model_sigma_nm = 0.0F,
                               .airgap_torque_nm = 0.0F,
                               .speed_rad_s = speed_rad_s,
                               .speed_sigma_rad_s = 0.0F,
                               .duration_s = out.duration_s,
                               .feed = feed,
                               .calibrated = tick_.calibrated != 0,
                               .valid = false}));
  inertia_.step({.torque_nm = 0.0F,
                 .speed_rad_s = 0.0F,
                 .duration_s = out.duration_s,
                 .valid = false,
                 .idle = false,
                 .in_cut = false,
                 .tare_nm = 0.0F,
                 .calibrated = false});
  out.valid = false;
  out.phase = AirCut::Phase::kUnsteady;
  out.speed_rad_s = speed_rad_s;
  return out;
}

float FusedObserver::sigma_nm(const LoadTorqueFilter::Output& load, const AirCut::Output& air,
                              float torque_nm, float copper, float change_nm) noexcept {
  const float rated = config_.filter.rated_torque_nm;
  const float model = 5e-4F * rated;
  const float scale = 0.003F * air.net_torque_nm;
  const float inertia = inertia_.sigma_ratio() * (torque_nm - load.load_torque_nm);
  const float found_ohm = resistance_.change_sigma_ohm();
  const float usual_ohm = kUsualResistance_ratio * config_.flux.stator_resistance_ohm;
  const float resistance =
      (found_ohm < usual_ohm ? found_ohm : usual_ohm) * (copper - tick_.idle_copper);
  const float fading = kFading_ratio * tick_.moved_nm;
  tick_.moved_nm = magnitude(change_nm) > fading ? magnitude(change_nm) : fading;
  const float moved = kLate_ticks * tick_.moved_nm;
  // Innovations larger than expected: the load moves in a way that neither model knows.
  tick_.consistency_ratio += kConsistencyShare * (load.consistency_ratio - tick_.consistency_ratio);
  const float excess = tick_.consistency_ratio > 1.0F ? tick_.consistency_ratio : 1.0F;
  const float noise = excess * load.variance_nm2 > air.idle_variance_nm2
                          ? excess * load.variance_nm2
                          : air.idle_variance_nm2;
  return std::sqrt(noise + model * model + scale * scale + inertia * inertia +
                   resistance * resistance + moved * moved +
                   air.tare_sigma_nm * air.tare_sigma_nm);  // (E104)
}

void FusedObserver::learn(const FluxTorque::Window& window, const Rotation& r, const Output& out,
                          float copper, float speed_rad_s) noexcept {
  if (out.phase == AirCut::Phase::kIdle) {
    const float power = window.power_w * config_.flux.pole_pairs / tick_.frequency_rad_s;
    const float share = out.idle_s <= out.duration_s ? 1.0F : kTareFollow_ratio;
    tick_.idle_copper += share * (copper - tick_.idle_copper);
    tick_.idle_power_torque_nm += share * (power - tick_.idle_power_torque_nm);
  }
  if (tick_.has_meter != 0) meter_.step(window.power_w, tick_.meter_w, out.duration_s);
  tick_.has_meter = 0;
  if (!config_.track_resistance || config_.sensorless) return;
  // |psi_R|^2 with the resistance found so far: psi less dR i / (j w_e).
  const float k = resistance_.change_ohm() / tick_.frequency_rad_s;
  const SpaceVector rotor{tick_.rotor_flux_v_s.alpha - k * window.current_a.beta,
                          tick_.rotor_flux_v_s.beta + k * window.current_a.alpha};
  resistance_.step({.flux_squared = dot(rotor, rotor),
                    .flux_frequency_rad_s = r.flux_rad_s,
                    .speed_rad_s = speed_rad_s,
                    .frequency_rad_s = tick_.frequency_rad_s,
                    .torque_nm = window.torque_nm,
                    .current_squared_a2 = window.current_squared_a2,
                    .idle_copper_nm_ohm = tick_.idle_copper,
                    .duration_s = out.duration_s,
                    .steady = tick_.even_s > 0.0F && tick_.calibrated != 0});
}

auto FusedObserver::delayed(float torque_nm, float moment_nm) noexcept -> std::array<float, 2> {
  if (config_.speed_delay_ticks == 0) return {torque_nm, moment_nm};
  constexpr std::uint32_t kSize = kLongestDelay + 1;
  if (tick_.ticks == 0) {
    for (std::uint32_t k = 0; k < kSize; ++k) {
      tick_.delayed_nm[2 * k] = torque_nm;
      tick_.delayed_nm[2 * k + 1] = moment_nm;
    }
  }
  const std::uint32_t now = 2 * (tick_.ticks % kSize);
  tick_.delayed_nm[now] = torque_nm;
  tick_.delayed_nm[now + 1] = moment_nm;
  const std::uint32_t then = 2 * ((tick_.ticks + kSize - config_.speed_delay_ticks) % kSize);
  return {tick_.delayed_nm[then], tick_.delayed_nm[then + 1]};
}

auto FusedObserver::tick(AirCut::Feed feed) noexcept -> Output {
  const FluxTorque::Window window = flux_.take();
  if (!(window.duration_s > 0.0F)) return Output{};
  const float h = window.duration_s;
  const Rotation r = rotation(window);
  track_frequency(r, h);
  const bool locked = tick_.locked_s > kLock_s;
  const Speed speed = take_speed(r, window.torque_nm, locked, h);
  const float airgap_power_w =
      window.power_w - 1.5F * config_.flux.stator_resistance_ohm * window.current_squared_a2;
  if (!locked || (!speed.valid && tick_.ticks == 0)) {
    Output out{};
    out.duration_s = h;
    out.frequency_rad_s = tick_.frequency_rad_s;
    out.airgap_torque_nm = window.torque_nm;
    out.airgap_power_w = airgap_power_w;
    return unlocked(speed.mean_rad_s, feed, out);
  }

  const float p = config_.flux.pole_pairs;
  const float copper = 1.5F * window.current_squared_a2 * p / tick_.frequency_rad_s;
  const float torque = window.torque_nm + correction_nm(window, copper);
  LoadTorqueFilter::Noise noise = noise_.noise();
  const bool by_angle = noise_.counts() || config_.sensorless;
  noise.centre_ratio =
      by_angle ? 0.5F : 0.5F - 0.5F / (speed.samples > 1.0F ? speed.samples : 1.0F);
  if (config_.sensorless) noise.torque_variance *= 4.0F;
  const float moment =
      by_angle ? window.moment_nm + 0.5F * window.torque_nm * config_.flux.sample_period_s / h
               : window.moment_nm;
  const auto [waited_nm, waited_moment_nm] = delayed(torque, moment);
  const LoadTorqueFilter::Input input{.torque_nm = waited_nm,
                                      .moment_nm = waited_moment_nm,
                                      .speed_rad_s = speed.mean_rad_s,
                                      .duration_s = h,
                                      .inertia_kg_m2 = inertia_.inertia_kg_m2(),
                                      .speed_valid = speed.valid};
  if (tick_.ticks == 0) {
    filter_.start(speed.mean_rad_s, 1.0F, torque, config_.filter.rated_torque_nm);
  }
  ++tick_.ticks;

  const LoadTorqueFilter::Output load = filter_.step(input, noise);
  const float change = load.load_torque_nm - tick_.load_torque_nm;
  tick_.load_torque_nm = load.load_torque_nm;
  const AirCut::Output air =
      air_.step({.load_torque_nm = load.load_torque_nm,
                 .sigma_nm = std::sqrt(load.variance_nm2),
                 .model_sigma_nm = magnitude(resistance_.change_sigma_ohm() * copper),
                 .airgap_torque_nm = torque,
                 // The field's own speed is calmer than what the flux says of the shaft's.
                 .speed_rad_s = config_.sensorless ? (tick_.frequency_rad_s - speed.slip_rad_s) / p
                                                   : load.speed_rad_s,
                 .speed_sigma_rad_s = std::sqrt(noise.speed_variance + 2.0F * noise.angle_variance),
                 .duration_s = h,
                 .feed = feed,
                 .calibrated = tick_.calibrated != 0,
                 .valid = true});
  const bool idle = air.phase == AirCut::Phase::kIdle;
  if (speed.valid) {
    noise_.step({.torque_nm = input.torque_nm,
                 .moment_nm = input.moment_nm,
                 .speed_rad_s = speed.mean_rad_s,
                 .duration_s = h,
                 .inertia_kg_m2 = input.inertia_kg_m2,
                 .idle = idle,
                 .calibrated = tick_.calibrated != 0});
  }
  // Before the first tare a ripple may be what keeps the torque from being known well enough.
  const bool even = air.steady && tick_.calibrated != 0 && !air.has_tare;
  if ((idle || even) && tick_.even_s > kRippleWait_s && speed.valid &&
      magnitude(speed.mean_rad_s) > kRippleSpeed_rad_s && !config_.sensorless) {
    ripple_.learn(noise_.rest_rad_s() + tick_.ripple_rad_s, h);
  }
  inertia_.step({.torque_nm = window.torque_nm,
                 .speed_rad_s = load.speed_rad_s,
                 .duration_s = h,
                 .valid = tick_.locked_s > kLock_s + kInertiaWait_s,
                 .idle = idle && air.idle_s > kAveragedTare_s,
                 .in_cut = air.phase == AirCut::Phase::kCut,
                 .tare_nm = load.speed_rad_s < 0.0F ? -air.tare_nm : air.tare_nm,
                 .calibrated = tick_.calibrated != 0});

  if (air.steady) {
    tick_.even_angle_rad += r.current_rad_s * h;
    tick_.even_s += h;
  } else {
    tick_.even_angle_rad = tick_.even_s = 0.0F;
  }
  // Channel offsets ripple the angle once a turn of the field: only the mean of turns counts.
  const bool even_turns = magnitude(tick_.even_angle_rad) > kEvenTurns * kTwoPi;
  const Output out{.valid = true,
                   .calibrated = tick_.calibrated != 0,
                   .tared = air.has_tare,
                   .phase = air.phase,
                   .airgap_power_w = airgap_power_w,
                   .airgap_torque_nm = torque,
                   .load_torque_nm = load.load_torque_nm,
                   .net_torque_nm = air.net_torque_nm,
                   .net_sigma_nm = sigma_nm(load, air, torque, copper, change),
                   .speed_rad_s = load.speed_rad_s,
                   .frequency_rad_s = tick_.frequency_rad_s,
                   .even_frequency_rad_s = even_turns ? tick_.even_angle_rad / tick_.even_s : 0.0F,
                   .tare_nm = air.tare_nm,
                   .tare_age_s = air.tare_age_s,
                   .idle_s = air.idle_s,
                   .duration_s = h};
  learn(window, r, out, copper, speed.mean_rad_s);
  return out;
}

}  // namespace cutforce::estimator
