#include "estimator/fused_observer.hpp"

#include <cmath>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kTwoPi = 6.28318530718F;
constexpr float kFrequencyTime_s = 0.015F;
constexpr float kLowestFrequency_rad_s = kTwoPi * 3.0F;
constexpr float kLock_s = 0.03F;
constexpr float kNoiseTime_s = 0.5F;
constexpr float kExplainTime_s = 0.1F;
constexpr float kOutlier_ratio = 9.0F;
constexpr float kDifferenceTime_s = 0.2F;
constexpr float kSpeedFloor_rad_s = 3e-5F;  // rounding of a recorded speed
constexpr float kFluxWander_ratio = 0.05F;  // the flux angle always wanders a little
constexpr float kFluxFloor_rad_s = 0.01F;
constexpr float kColour_s = 0.3F;
constexpr float kShortestNoiseMeasure_s = 0.05F;

float magnitude(float x) noexcept { return x < 0.0F ? -x : x; }

float rotated(SpaceVector now, SpaceVector before) noexcept {
  return angle_of(dot(now, before), cross(now, before));
}

}  // namespace

FusedObserver::FusedObserver(const Config& config, const FluxTorque& flux,
                             const LoadTorqueFilter& filter, const AirCut& air) noexcept
    : config_(config), flux_(flux), filter_(filter), air_(air) {
  const float torque_sigma_nm = 0.02F * config.filter.rated_torque_nm;
  own_.noise.filter = {.speed_variance = 0.03F * 0.03F,
                       .angle_variance = 0.0F,
                       .torque_variance = torque_sigma_nm * torque_sigma_nm,
                       .centre_ratio = 0.0F};
}

auto FusedObserver::make(const Config& config) noexcept
    -> std::expected<FusedObserver, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return FusedObserver{config, *FluxTorque::make(config.flux),
                       *LoadTorqueFilter::make(config.filter), *AirCut::make(config.air)};
}

auto FusedObserver::state() const noexcept -> State {
  State state = own_;
  state.flux = flux_.state();
  state.filter = filter_.state();
  state.air = air_.state();
  return state;
}

void FusedObserver::restore(const State& state) noexcept {
  own_ = state;
  flux_.restore(state.flux);
  filter_.restore(state.filter);
  air_.restore(state.air);
}

void FusedObserver::step(const Sample& sample) noexcept {
  flux_.step(sample.motor, sample.elapsed_periods);
  if (sample.speed_valid) {
    own_.speed_sum_rad_s += sample.speed_rad_s;
    ++own_.speed_count;
  }
}

void FusedObserver::recalibrated(SpaceVector voltage_offset_v, SpaceVector current_offset_a) noexcept {
  flux_.remove_offset(voltage_offset_v, current_offset_a);
  const SpaceVector psi = flux_.state().flux_v_s;
  const SpaceVector i = flux_.state().current_a;
  const float l = config_.leakage_inductance_h;
  own_.rotor_flux_v_s = {psi.alpha - l * i.alpha, psi.beta - l * i.beta};
  own_.current_a = i;
  own_.noise.idle_s = 0.0F;
  own_.calibrated = 1;
  filter_.loosen(0.02F * config_.filter.rated_torque_nm);
  air_.restart_average();
}

auto FusedObserver::rotation(const FluxTorque::Window& window) noexcept -> Rotation {
  const float l = config_.leakage_inductance_h;
  const SpaceVector i = window.current_a;
  const SpaceVector rotor{window.flux_v_s.alpha - l * i.alpha, window.flux_v_s.beta - l * i.beta};
  const Rotation result{.flux_rad_s = rotated(rotor, own_.rotor_flux_v_s) / window.duration_s,
                        .current_rad_s = rotated(i, own_.current_a) / window.duration_s,
                        .flux_squared = dot(rotor, rotor)};
  own_.rotor_flux_v_s = rotor;
  own_.current_a = i;
  return result;
}

void FusedObserver::track_frequency(const Rotation& r, float duration_s) noexcept {
  const float w = own_.frequency_rad_s;
  const float size = magnitude(w);
  const float flux_floor = 0.3F * config_.rated_flux_v_s;
  const bool flux_agrees = r.flux_squared > flux_floor * flux_floor &&
                           magnitude(r.flux_rad_s - w) < 0.3F * size + 20.0F &&
                           magnitude(r.current_rad_s - w) < 0.5F * size + 60.0F;
  const float seen = flux_agrees ? r.flux_rad_s : r.current_rad_s;
  const float share = duration_s < kFrequencyTime_s
                          ? 1.0F - exp_bounded(-duration_s / kFrequencyTime_s)
                          : 0.63F;
  own_.frequency_rad_s += share * (seen - w);  // (E101)
  flux_.set_frequency(own_.frequency_rad_s);

  const bool turning = magnitude(own_.frequency_rad_s) > kLowestFrequency_rad_s;
  const bool agrees = magnitude(r.current_rad_s - own_.frequency_rad_s) <
                      0.3F * magnitude(own_.frequency_rad_s) + 20.0F;
  const bool was_locked = own_.locked_s > 0.0F;
  if (turning && (agrees || was_locked)) {
    if (!was_locked) flux_.seed();
    own_.locked_s += duration_s;
  } else {
    own_.locked_s = 0.0F;
  }
}

void FusedObserver::measure_noise(const LoadTorqueFilter::Input& input, float centre_ratio,
                                  bool idle) noexcept {
  Noise& n = own_.noise;
  const auto [torque_nm, moment_nm, speed_rad_s, h, valid] = input;
  if (!valid) return;
  const float g = h / config_.filter.inertia_kg_m2;
  n.idle_s = idle ? n.idle_s + h : 0.0F;
  if (n.seen_s <= 0.0F || (idle && n.idle_s <= h)) {
    n.explained_rad_s = speed_rad_s;
    n.slow_torque_nm = torque_nm;
    n.seen_s = 0.0F;
  }
  n.slow_torque_nm += (torque_nm - n.slow_torque_nm) * h / kExplainTime_s;
  n.explained_rad_s += g * (torque_nm - n.slow_torque_nm);
  const float residual =
      speed_rad_s - n.explained_rad_s + g * (moment_nm - centre_ratio * n.slow_torque_nm);
  n.explained_rad_s += residual * h / kExplainTime_s;
  const float unexplained =
      torque_nm - moment_nm + n.last_moment_nm - (speed_rad_s - n.last_speed_rad_s) / g;
  const float d3 = torque_nm - 3.0F * n.torque_nm[0] + 3.0F * n.torque_nm[1] - n.torque_nm[2];
  const float d2 = unexplained - 2.0F * n.unexplained_nm[0] + n.unexplained_nm[1];
  const float change = residual - n.residual_rad_s;

  n.seen_s += h;
  if (n.seen_s > 5.0F * h && (idle || n.idle_measured == 0)) {
    const float longest_s = idle ? kNoiseTime_s : kDifferenceTime_s;
    const float time_s = n.seen_s < longest_s ? n.seen_s : longest_s;
    const float share = h / time_s;
    // A change that is far out (a calibration, a contact not yet seen) must not count as noise.
    const float bound = n.seen_s > 20.0F * h ? kOutlier_ratio * n.e0 : change * change;
    const float squared = change * change;
    const float shrink = squared > bound ? bound / squared : 1.0F;
    n.e0 += share * (shrink * squared - n.e0);
    n.e1 += share * (shrink * change * n.step_rad_s - n.e1);
    n.third_torque += share * (d3 * d3 * (1.0F / 20.0F) - n.third_torque);
    n.second_unexplained += share * (d2 * d2 * (1.0F / 6.0F) - n.second_unexplained);
  }
  n.step_rad_s = change;
  n.residual_rad_s = residual;
  n.last_moment_nm = moment_nm;
  n.last_speed_rad_s = speed_rad_s;
  n.torque_nm = {torque_nm, n.torque_nm[0], n.torque_nm[1]};
  n.unexplained_nm = {unexplained, n.unexplained_nm[0]};
  if (idle && n.idle_s > kShortestNoiseMeasure_s && own_.calibrated != 0) n.idle_measured = 1;
  if (n.seen_s < (n.measured != 0 ? 0.1F : 0.02F) || (!idle && n.idle_measured != 0)) return;

  // Of the changes: white noise gives E0 = 2 W, E1 = -W; angle noise 6 A, -4 A.
  float angle = -0.5F * n.e0 - n.e1;
  if (angle > n.e0 * (1.0F / 6.0F)) angle = n.e0 * (1.0F / 6.0F);
  if (!(angle > 0.1F * n.e0)) angle = 0.0F;  // within the scatter of e1
  float white = 0.5F * n.e0 - 3.0F * angle;
  float floor = kSpeedFloor_rad_s * kSpeedFloor_rad_s;
  if (config_.sensorless) floor += kFluxWander_ratio * n.e0 + kFluxFloor_rad_s * kFluxFloor_rad_s;
  if (!(white > floor)) white = floor;
  if (n.idle_s > kColour_s) {
    // What is left of slow, coloured noise counts as white, else the filter believes it.
    const float share = h / kNoiseTime_s;
    const float known = white + 2.0F * angle;
    if (n.idle_s - h <= kColour_s) n.c0 = known;
    const float squared = residual * residual;
    const float bound = kOutlier_ratio * n.c0;
    n.c0 += share * ((squared < bound ? squared : bound) - n.c0);
    if (n.c0 > known) white += n.c0 - known;
  }
  n.measured = 1;
  n.filter.speed_variance = white;
  n.filter.angle_variance = angle;
  n.filter.torque_variance =
      n.third_torque < n.second_unexplained ? n.third_torque : n.second_unexplained;
}

auto FusedObserver::tick(AirCut::Feed feed) noexcept -> Output {
  const FluxTorque::Window window = flux_.take();
  Output out{};
  if (!(window.duration_s > 0.0F)) return out;
  const float h = window.duration_s;
  const Rotation r = rotation(window);
  track_frequency(r, h);

  const float p = config_.flux.pole_pairs;
  const float torque = window.torque_nm;
  bool speed_valid = own_.speed_count > 0;
  float speed = speed_valid ? own_.speed_sum_rad_s / static_cast<float>(own_.speed_count) : 0.0F;
  const auto samples = static_cast<float>(own_.speed_count);
  own_.speed_sum_rad_s = 0.0F;
  own_.speed_count = 0;
  const bool locked = own_.locked_s > kLock_s;
  if (config_.sensorless) {
    speed_valid = locked && r.flux_squared > 0.0F;
    const float slip = speed_valid ? 2.0F * config_.rotor_resistance_ohm * torque /
                                         (3.0F * p * r.flux_squared)
                                   : 0.0F;
    speed = (r.flux_rad_s - slip) / p;  // (E102)
  }

  LoadTorqueFilter::Noise noise = own_.noise.filter;
  const bool by_angle = noise.angle_variance > 0.0F || config_.sensorless;
  noise.centre_ratio = by_angle ? 0.5F : 0.5F * (samples - 1.0F) / (samples > 0.0F ? samples : 1.0F);
  if (config_.sensorless) noise.torque_variance *= 4.0F;

  out.duration_s = h;
  out.frequency_rad_s = own_.frequency_rad_s;
  out.airgap_torque_nm = torque;
  out.airgap_power_w =
      window.power_w - 1.5F * config_.flux.stator_resistance_ohm * window.current_squared_a2;
  out.valid = locked && (speed_valid || own_.ticks > 0);
  if (!locked) {
    own_.ticks = 0;
    if (speed_valid) filter_.start(speed, 0.0F, config_.filter.rated_torque_nm);
    out.speed_rad_s = speed;
    static_cast<void>(air_.step({.load_torque_nm = 0.0F, .sigma_nm = 0.0F, .airgap_torque_nm = torque,
                                 .speed_rad_s = speed, .speed_sigma_rad_s = 0.0F, .duration_s = h,
                                 .feed = feed, .calibrated = false, .valid = false}));
    own_.noise.idle_s = 0.0F;
    own_.noise.seen_s = 0.0F;
    out.valid = false;
    return out;
  }
  if (own_.ticks == 0) filter_.start(speed, torque, config_.filter.rated_torque_nm);
  ++own_.ticks;

  const float moment_nm =
      by_angle ? window.moment_nm + 0.5F * torque * config_.flux.sample_period_s / h
               : window.moment_nm;
  const LoadTorqueFilter::Input input{.torque_nm = torque,
                                      .moment_nm = moment_nm,
                                      .speed_rad_s = speed,
                                      .duration_s = h,
                                      .speed_valid = speed_valid};
  const LoadTorqueFilter::Output load = filter_.step(input, noise);
  const float change = load.load_torque_nm - own_.load_torque_nm;
  own_.load_torque_nm = load.load_torque_nm;

  const float speed_sigma = std::sqrt(noise.speed_variance + 2.0F * noise.angle_variance);
  const AirCut::Output air = air_.step({.load_torque_nm = load.load_torque_nm,
                                        .sigma_nm = std::sqrt(load.variance_nm2),
                                        .airgap_torque_nm = torque,
                                        .speed_rad_s = load.speed_rad_s,
                                        .speed_sigma_rad_s = speed_sigma,
                                        .duration_s = h,
                                        .feed = feed,
                                        .calibrated = own_.calibrated != 0,
                                        .valid = true});
  if (air.phase == AirCut::Phase::kIdle) {
    own_.idle_current_a2 += (window.current_squared_a2 - own_.idle_current_a2) * 0.02F;
  }
  measure_noise(input, noise.centre_ratio, air.phase == AirCut::Phase::kIdle);

  // (E104)
  const float rated = config_.filter.rated_torque_nm;
  const float model = 5e-4F * rated;
  const float scale = 0.003F * air.net_torque_nm;
  const float inertia = config_.inertia_sigma_ratio * (torque - load.load_torque_nm);
  const float copper = 1.5F * config_.stator_resistance_sigma_ohm *
                       (window.current_squared_a2 - own_.idle_current_a2) * p /
                       own_.frequency_rad_s;
  const float noise2 = load.variance_nm2 > air.idle_variance_nm2 ? load.variance_nm2
                                                                 : air.idle_variance_nm2;
  const float moved = 0.7F * change;
  out.phase = air.phase;
  out.steady = air.steady;
  out.calibrated = own_.calibrated != 0;
  out.load_torque_nm = load.load_torque_nm;
  out.net_torque_nm = air.net_torque_nm;
  out.net_sigma_nm = std::sqrt(noise2 + model * model + scale * scale + inertia * inertia +
                               copper * copper + moved * moved +
                               air.tare_sigma_nm * air.tare_sigma_nm);
  out.speed_rad_s = load.speed_rad_s;
  out.tare_nm = air.tare_nm;
  out.tare_age_s = air.tare_age_s;
  out.idle_s = air.idle_s;
  return out;
}

}  // namespace cutforce::estimator
