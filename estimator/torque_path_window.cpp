// From the samples of a window to its means, its speeds, and torques with their uncertainty. One
// function of steps that are inlined: a window's values stay in registers, and a Cortex-M7 closes
// it with half the instructions.
#include <algorithm>
#include <cmath>

#include "estimator/idle_tare_step.hpp"
#include "estimator/torque_path.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kSmallestFluxV2s2 = 1e-6F;  // only keeps a division finite

}  // namespace

struct TorquePath::Window {
  float airgap_power_w;
  float current_square_a2;
  float above_idle_a2;  // of that, against where the tare was taken before
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

struct TorquePath::Load {
  IdleTare::Output tare;
  float inertia_torque_nm;
  float not_cutting_nm;  // what stands between air-gap torque and torque above idle
};

struct TorquePath::Choice {
  Origin origin;
  float factor_ratio;  // of the cutting torque
  float airgap_torque_nm;
  float divisor_rad_s;  // that its power was divided by
};

[[gnu::always_inline]] inline auto TorquePath::window(
    const AirGapPower::Output& power, const SynchronousSpeed::Output& synchronous) noexcept
    -> Window {
  const std::uint32_t samples = settings_.samples_per_window;
  Window means;
  means.has_airgap_power = sums_.motor_samples == samples;
  means.airgap_power_w = power.airgap_power_w;
  means.current_square_a2 = power.current_square_a2;
  means.above_idle_a2 = power.current_square_a2 - sums_.idle_current_square_a2;
  means.noise_variance_w2 = power.noise_variance_w2;
  find_speeds(synchronous, means);
  // A meter is slow: some readings of the window will do.
  means.has_measured_power = 2 * sums_.meter_samples >= samples;
  means.measured_power_w = means.measured_sigma_w = 0.0F;
  if (means.has_measured_power) {
    const auto measured =
        blocks_.meter.step({.meter_w = sums_.meter_w / static_cast<float>(sums_.meter_samples),
                            .speed_rad_s = means.speed_rad_s});
    means.measured_power_w = measured.power_w;
    means.measured_sigma_w = measured.sigma_w;
  }
  return means;
}

[[gnu::always_inline]] inline void TorquePath::find_speeds(
    const SynchronousSpeed::Output& synchronous, Window& window) const noexcept {
  const bool has_sensor = sums_.speed_samples == settings_.samples_per_window;
  const bool has_rotation = window.has_airgap_power && synchronous.valid;
  window.has_speed = has_sensor || has_rotation;
  window.has_sensor = has_sensor;
  float mean = sums_.speed_rad_s / settings_.count;
  float end = sums_.last_speed_rad_s;
  float divide = mean;
  if (has_rotation && (!has_sensor || settings_.speed != Speed::kRotor)) {
    const float flux_square = std::max(synchronous.flux_square_v2s2, kSmallestFluxV2s2);
    if (!has_sensor) {
      // (E29) the other way round.
      const float slip = settings_.rotor_resistance_ohm * window.airgap_power_w /
                         (settings_.slip_ohm * flux_square * synchronous.synchronous_rad_s);
      mean = synchronous.synchronous_rad_s - slip;
      end = synchronous.synchronous_end_rad_s - slip;
      divide = synchronous.synchronous_rad_s;
    } else if (settings_.speed == Speed::kSynchronous) {
      divide = synchronous.synchronous_rad_s;
    } else {
      divide =
          synchronous_speed_from_slip(mean, window.airgap_power_w, settings_.rotor_resistance_ohm,
                                      settings_.pole_pairs, flux_square);
    }
  }
  window.direction = mean < 0.0F ? -1.0F : 1.0F;
  window.speed_rad_s = window.has_speed ? window.direction * mean : 0.0F;
  window.end_speed_rad_s = window.direction * end;
  window.power_speed_rad_s = window.direction * divide;
}

[[gnu::always_inline]] inline auto TorquePath::follow_load(const Window& window,
                                                           float airgap_torque_nm,
                                                           Feed feed) noexcept -> Load {
  if (!window.has_speed) blocks_.drive.restart();
  const float viscous = blocks_.tare.state().viscous_nm_s_rad;
  const auto driven = blocks_.drive.step({.airgap_torque_nm = airgap_torque_nm,
                                          .speed_rad_s = window.end_speed_rad_s,
                                          .viscous_nm_s_rad = viscous});
  const bool has_power = window.has_airgap_power || window.has_measured_power;
  Load load{.tare = blocks_.tare.step_inlined({.load_torque_nm = driven.load_torque_nm,
                                               .inertia_torque_nm = driven.inertia_torque_nm,
                                               .speed_rad_s = window.speed_rad_s,
                                               .feed = feed,
                                               .valid = has_power && window.has_speed}),
            .inertia_torque_nm = driven.inertia_torque_nm,
            .not_cutting_nm = airgap_torque_nm - driven.external_torque_nm};
  if (load.tare.taring && window.has_airgap_power) {
    sums_.idle_current_square_a2 = window.current_square_a2;
    if (window.has_measured_power) blocks_.meter.calibrate(window.airgap_power_w);
  }
  // The tare may have changed B since the drive model used it.
  const float changed_nm = (load.tare.viscous_nm_s_rad - viscous) * window.speed_rad_s;
  load.not_cutting_nm = load.not_cutting_nm + load.tare.coulomb_nm + changed_nm;
  return load;
}

// P3 (1) or (4), by the speed that find_speeds chose.
[[gnu::always_inline]] inline auto TorquePath::choose(const Window& window,
                                                      float leading_nm) noexcept -> Choice {
  bool use_computed = settings_.method != Method::kMeasured && window.has_airgap_power;
  float factor = 1.0F;
  if (window.has_airgap_power && window.has_measured_power) {
    const auto decided = blocks_.monitor.choose(window.airgap_power_w, window.measured_power_w);
    if (settings_.method == Method::kSynthesized) {
      use_computed = decided.computed;
      factor = decided.factor_ratio;
    }
  }
  const bool use_measured = settings_.method != Method::kComputed && window.has_measured_power;
  const float divisor = std::max(window.power_speed_rad_s, settings_.minimum_speed_rad_s);
  return {.origin = use_computed   ? Origin::kComputed
                    : use_measured ? Origin::kMeasured
                                   : Origin::kNone,
          .factor_ratio = factor,
          .airgap_torque_nm = use_computed ? leading_nm : window.measured_power_w / divisor,
          .divisor_rad_s = divisor};
}

// Of the torque above idle: (E48) without its last term.
[[gnu::always_inline]] inline auto TorquePath::torque_variance(const Window& window,
                                                               const Load& load,
                                                               const Choice& chosen) const noexcept
    -> float {
  const float divisor = chosen.divisor_rad_s;
  float power_nm2 = 0.0F;
  float model_nm2 = 0.0F;
  if (chosen.origin == Origin::kComputed) {
    const float loss = settings_.loss_sigma_ohm * window.above_idle_a2;
    power_nm2 = window.noise_variance_w2 / (divisor * divisor);
    model_nm2 = loss * loss / (divisor * divisor);
  } else {
    const float sigma = window.measured_sigma_w / divisor;
    model_nm2 = sigma * sigma;
  }
  const float seen = load.tare.noise_sigma_nm * load.tare.noise_sigma_nm;
  const float noise = std::max(power_nm2 + settings_.speed_variance_nm2, seen);
  const float inertia_nm = settings_.inertia_sigma_ratio * load.inertia_torque_nm;
  // P3 (4) overstates the torque by the slip, which grows with the torque itself.
  const bool slip_left_out = settings_.speed == Speed::kRotor && window.has_sensor;
  const float slip_nm = slip_left_out ? settings_.rated_slip_ratio * chosen.airgap_torque_nm *
                                            chosen.airgap_torque_nm / settings_.rated_torque_nm
                                      : 0.0F;
  return noise + model_nm2 + inertia_nm * inertia_nm + slip_nm * slip_nm +
         load.tare.sigma_nm * load.tare.sigma_nm;
}

[[gnu::always_inline]] inline void TorquePath::publish_torque(const Window& window,
                                                              const Load& load,
                                                              const Choice& chosen,
                                                              Output& output) noexcept {
  const auto cutting =
      blocks_.friction.step({.torque_nm = chosen.airgap_torque_nm - load.not_cutting_nm,
                             .speed_rad_s = window.speed_rad_s});
  const float cutting_nm = cutting.cutting_torque_nm * chosen.factor_ratio;
  const float sensitivity = cutting.sensitivity_ratio * chosen.factor_ratio;
  const float motion = sums_.has_torque != 0 ? 0.5F * (cutting_nm - sums_.cutting_torque_nm) : 0.0F;
  sums_.cutting_torque_nm = cutting_nm;
  sums_.has_torque = 1;
  const float variance = sensitivity * sensitivity * torque_variance(window, load, chosen);
  output.torque_valid = true;
  output.airgap_torque_nm = window.direction * chosen.airgap_torque_nm;
  output.load_torque_nm = window.direction * (chosen.airgap_torque_nm - load.inertia_torque_nm);
  output.cutting_torque_nm = window.direction * cutting_nm;
  output.cutting_torque_sigma_nm = std::sqrt(variance + motion * motion);  // (E48)
  output.origin = chosen.origin;
}

void TorquePath::close_window(Feed feed, Output& output) noexcept {
  const AirGapPower::Output power = blocks_.power.close_window();
  const SynchronousSpeed::Output synchronous = blocks_.synchronous.close_window();
  const Window means = window(power, synchronous);
  sums_.electrical_rad_s = synchronous.valid ? synchronous.electrical_rad_s : 0.0F;
  sums_.speed_rad_s = 0.0F;
  sums_.meter_w = 0.0F;
  sums_.motor_samples = 0;
  sums_.speed_samples = 0;
  sums_.meter_samples = 0;

  const float divisor = std::max(means.power_speed_rad_s, settings_.minimum_speed_rad_s);
  const float leading_w = means.has_airgap_power ? means.airgap_power_w : means.measured_power_w;
  const float leading_nm = leading_w / divisor;
  const Load load = follow_load(means, leading_nm, feed);
  const Choice chosen = choose(means, leading_nm);

  output.airgap_power_w = means.has_airgap_power ? means.airgap_power_w : 0.0F;
  output.measured_power_w = means.measured_power_w;
  output.speed_rad_s = means.direction * means.speed_rad_s;
  output.synchronous_rad_s =
      means.has_airgap_power && synchronous.valid ? synchronous.synchronous_rad_s : 0.0F;
  output.idle_torque_nm = means.direction * load.tare.idle_torque_nm;
  output.idle_torque_sigma_nm = load.tare.sigma_nm;
  output.tare_age_s = load.tare.age_s;
  output.airgap_power_valid = means.has_airgap_power;
  output.measured_power_valid = means.has_measured_power;
  output.speed_valid = means.has_speed;
  output.in_cut = load.tare.in_cut;
  output.tared = load.tare.acquired;
  const bool turning = means.has_speed && means.speed_rad_s >= settings_.minimum_speed_rad_s &&
                       means.power_speed_rad_s >= settings_.minimum_speed_rad_s;
  if (turning && chosen.origin != Origin::kNone) {
    publish_torque(means, load, chosen, output);
    return;
  }
  sums_.has_torque = 0;
  output.airgap_torque_nm = output.load_torque_nm = 0.0F;
  output.cutting_torque_nm = output.cutting_torque_sigma_nm = 0.0F;
  output.torque_valid = false;
  output.origin = Origin::kNone;
}

}  // namespace cutforce::estimator
