// Cutting torque from phase voltages and currents, speed, the slow power meter and their noise.
//
// Once a raw sample: FluxTorque, the air-gap torque. Once a tick (1 ms):
//   frequency  psi_R = psi - L_sigma i;  w_psi = arg(psi_R conj psi_R,prev)/h, w_i likewise (E100)
//              w_e += s (w_x - w_e) + a_e h,  a_e += s^2/4 (w_x - w_e)/h,  s = 1 - exp(-h/15 ms)
//              w_x = w_psi once calibrated and agreeing, else w_i (E101)
//   slow work  the filter's covariances, in one tick of four once they have settled
//   speed      measured less its ripple, or without a sensor
//              (w_psi - w_sl)/p, w_sl = 2 R_R T_m / (3 p |psi_R|^2) (E102)
//   noise      NoiseMeter (E103);  ripple  SpeedRipple (E105)
//   torque     T' = T - dR (x - x_tare) + (g - 1)(P_i - P_i,tare) p / w_e      StatorResistance
//              (E111), PowerScale (E122)
//   load       LoadTorqueFilter (E70)-(E74);  inertia  RunUpInertia (E115)
//   tare       AirCut (E90)-(E92)
//   sigma      sum of squares of: filter or idle scatter, model floor 5e-4 T_n, 0.3 % of the
//              torque, inertia, resistance, time stamp (change of this tick), tare (E104)
// Below 3 Hz stator frequency there is no estimate. Source: ESTIMATOR prototype 1; changes and
// derivations in EQUATIONS.md.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <span>
#include <type_traits>

#include "estimator/air_cut.hpp"
#include "estimator/flux_torque.hpp"
#include "estimator/load_torque_filter.hpp"
#include "estimator/noise_meter.hpp"
#include "estimator/power_scale.hpp"
#include "estimator/run_up_inertia.hpp"
#include "estimator/space_vector.hpp"
#include "estimator/speed_ripple.hpp"
#include "estimator/stator_resistance.hpp"

namespace cutforce::estimator {

class FusedObserver {
 public:
  enum class ConfigError : std::uint8_t {
    kFlux,
    kFilter,
    kAir,
    kInertia,
    kResistance,
    kMeter,
    kMotor
  };

  struct Config {
    FluxTorque::Config flux;
    LoadTorqueFilter::Config filter;
    AirCut::Config air;
    RunUpInertia::Config inertia;
    StatorResistance::Config resistance;
    PowerScale::Config meter;
    float leakage_inductance_h;       // star-equivalent, inverse-gamma
    float rated_flux_v_s;             // about; decides only what is plausible
    std::uint32_t speed_delay_ticks;  // the measured speed is this late; the torque waits for it
    bool sensorless;                  // speed from the flux
    bool track_resistance;
    bool calibrate;  // wait for the idle calibration before the first tare

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!flux.check()) return std::unexpected{ConfigError::kFlux};
      if (!filter.check()) return std::unexpected{ConfigError::kFilter};
      if (!air.check()) return std::unexpected{ConfigError::kAir};
      if (!inertia.check()) return std::unexpected{ConfigError::kInertia};
      if (!resistance.check()) return std::unexpected{ConfigError::kResistance};
      if (!meter.check()) return std::unexpected{ConfigError::kMeter};
      if (!(leakage_inductance_h >= 0.0F && rated_flux_v_s > 0.0F &&
            speed_delay_ticks <= kLongestDelay))
        return std::unexpected{ConfigError::kMotor};
      return {};
    }
  };

  static constexpr std::uint32_t kLongestDelay = 15;  // ticks

  struct Sample {
    MotorSample motor;
    float speed_rad_s;
    float power_meter_w;
    float elapsed_periods;
    bool speed_valid;
    bool meter_valid;
  };

  struct Output {
    bool valid;  // an estimate exists
    bool calibrated;
    bool tared;
    AirCut::Phase phase;
    float airgap_power_w;
    float airgap_torque_nm;  // mean of the tick, corrected
    float load_torque_nm;    // after inertia
    float net_torque_nm;     // less nominal friction and tare: T_C + load friction
    float net_sigma_nm;
    float speed_rad_s;
    float frequency_rad_s;       // electrical
    float even_frequency_rad_s;  // its mean since the speed stands still; 0: not for long enough
    float tare_nm;
    float tare_age_s;
    float idle_s;  // time in this idle
    float duration_s;
  };

  struct Tick {
    SpaceVector rotor_flux_v_s{};
    SpaceVector current_a{};
    float frequency_rad_s = 0.0F;
    float acceleration_rad_s2 = 0.0F;  // of the frequency
    float locked_s = 0.0F;
    float even_angle_rad = 0.0F;  // that the flux has turned since the speed stands still
    float even_s = 0.0F;
    float speed_sum_rad_s = 0.0F;
    std::uint32_t speed_count = 0;
    float meter_w = 0.0F;
    std::uint32_t has_meter = 0;  // in this tick
    float ripple_rad_s = 0.0F;    // taken off the speed of this tick
    float load_torque_nm = 0.0F;
    float moved_nm = 0.0F;              // largest recent change of a tick, fading
    float consistency_ratio = 1.0F;     // of the innovations, averaged
    float idle_copper = 0.0F;           // x of (E110) when the tare was taken
    float idle_power_torque_nm = 0.0F;  // P_i p / w_e likewise
    std::uint32_t ticks = 0;            // since the estimate became valid
    std::uint32_t calibrated = 0;
  };
  using Delayed = std::array<float, 2 * (kLongestDelay + 1)>;  // torque and its moment, a ring

  struct State {
    FluxTorque::State flux;
    LoadTorqueFilter::State filter;
    AirCut::State air;
    NoiseMeter::State noise;
    SpeedRipple::State ripple;
    RunUpInertia::State inertia;
    StatorResistance::State resistance;
    PowerScale::State meter;
    Tick tick;
    Delayed delayed_nm;
  };

  [[nodiscard]] static constexpr std::expected<FusedObserver, ConfigError> make(
      const Config& config) noexcept;
  // Of a config that check() accepts, made where it stays.
  [[nodiscard]] static constexpr FusedObserver make_checked(const Config& config) noexcept {
    return FusedObserver{config};
  }

  void step(const Sample& sample) noexcept {
    flux_.step(sample.motor, sample.elapsed_periods);
    if (sample.speed_valid) note_speeds(speed_sum_rad_s() + sample.speed_rad_s, 1);
    if (sample.meter_valid) note_meter(sample.power_meter_w);
  }
  // The same in its parts: samples that follow each other by one period, or one that does not,
  void step_run(std::span<const MotorSample> motor) noexcept { flux_.step_run(motor); }
  void step(const MotorSample& motor, float elapsed_periods) noexcept {
    flux_.step(motor, elapsed_periods);
  }
  // the sum of all speeds since the last tick, with `count` new ones in it,
  void note_speeds(float sum_rad_s, std::uint32_t count) noexcept {
    tick_.speed_sum_rad_s = sum_rad_s;
    tick_.speed_count += count;
  }
  // and the latest reading of the meter.
  void note_meter(float power_w) noexcept {
    tick_.meter_w = power_w;
    tick_.has_meter = 1;
  }
  // Of the speeds since the last tick.
  [[nodiscard]] float speed_sum_rad_s() const noexcept { return tick_.speed_sum_rad_s; }
  [[nodiscard]] std::uint32_t speed_count() const noexcept { return tick_.speed_count; }
  [[nodiscard]] Output tick(AirCut::Feed feed) noexcept;

  // Samples are missing: what was learned stays, what was integrated begins anew.
  void restart() noexcept;

  // Voltages and currents to come are corrected by these offsets (idle calibration).
  void recalibrated(SpaceVector voltage_offset_v, SpaceVector current_offset_a) noexcept;

  [[nodiscard]] State state() const noexcept;
  void restore(const State& state) noexcept;

 private:
  static constexpr float kLeastFlux_ratio = 0.3F;
  static constexpr float kModel_ratio = 5e-4F;
  static constexpr float kUsualResistance_ratio =
      0.1F;  // what temperature does to copper, one sigma

  explicit constexpr FusedObserver(const Config& config) noexcept;

  // What is left to read of the configuration once the parts are made.
  struct Settings {
    float sample_period_s;
    float pole_pairs;
    float leakage_inductance_h;
    float least_flux_squared;  // that is believed
    float copper_loss_ohm;     // 1.5 R_s
    float slip_ohm;            // 2 R_R/(3 p)
    float rated_torque_nm;
    float model_variance_nm2;
    float usual_ohm;  // what temperature does to the resistance
    std::uint32_t speed_delay_ticks;
    std::uint32_t sensorless;
    std::uint32_t tracks_resistance;
  };
  // Of the tick's length, found anew where it changes: ticks are nearly always of one length.
  struct Length {
    float tick_s;
    float ticks_per_s;
    float keep;               // 1 - s of (E101)
    float acceleration_1_s2;  // s^2/4/h
  };
  struct Rotation {
    float seen_rad;     // that the vector which is believed turned by
    float current_rad;  // that the current turned by
    float flux_rad_s;
    float flux_squared;
  };
  struct Speed {
    float mean_rad_s;
    float slip_rad_s;  // electrical; sensorless only
    float samples;
    bool valid;
  };
  // Torque of a tick and what it was corrected by.
  struct Torque {
    float copper;    // x of (E110)
    float by_power;  // P_i p / w_e
    float mean_nm;
    float moment_nm;
  };
  void renew_length(float tick_s) noexcept;
  [[nodiscard]] Rotation rotation(const FluxTorque::Window& window) noexcept;
  void track_frequency(const Rotation& rotation) noexcept;
  [[nodiscard]] bool locks(float current_rad) noexcept;
  [[nodiscard]] Speed take_speed(const Rotation& rotation, float torque_nm) noexcept;
  [[nodiscard]] Torque corrected(const FluxTorque::Window& window) const noexcept;
  [[nodiscard]] LoadTorqueFilter::Output filter(const Torque& torque, const Speed& speed,
                                                const LoadTorqueFilter::Noise& noise) noexcept;
  [[nodiscard]] LoadTorqueFilter::Noise noise(const Speed& speed, bool by_angle) const noexcept;
  void delay(Torque& torque) noexcept;
  void learn_ripple(const AirCut::Output& air, float speed_rad_s) noexcept;
  void note_even(bool steady, float turned_rad) noexcept;
  void learn(const FluxTorque::Window& window, const Rotation& rotation, const Torque& torque,
             const AirCut::Output& air, float speed_rad_s) noexcept;
  void learn_resistance(const FluxTorque::Window& window, float flux_rad_s,
                        float speed_rad_s) noexcept;
  [[nodiscard]] float sigma_nm(const LoadTorqueFilter::Output& load, const AirCut::Output& air,
                               const Torque& torque, float change_nm) noexcept;
  [[nodiscard]] Output unlocked(const FluxTorque::Window& window, float speed_rad_s,
                                AirCut::Feed feed) noexcept;
  [[nodiscard]] float airgap_power_w(const FluxTorque::Window& window) const noexcept {
    return window.power_w - settings_.copper_loss_ohm * window.current_squared_a2;
  }

  // In this order because a Cortex-M7 reaches floats no further than 1020 bytes from a base: what
  // every sample needs first, what a tick seldom needs last.
  FluxTorque flux_;
  Tick tick_{};
  Settings settings_;
  Length length_{};
  LoadTorqueFilter filter_;
  AirCut air_;
  RunUpInertia inertia_;
  PowerScale meter_;
  NoiseMeter noise_;
  SpeedRipple ripple_{};
  StatorResistance resistance_;
  Delayed delayed_nm_{};
};

constexpr auto FusedObserver::make(const Config& config) noexcept
    -> std::expected<FusedObserver, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return FusedObserver{config};
}

constexpr FusedObserver::FusedObserver(const Config& config) noexcept
    : flux_(*FluxTorque::make(config.flux)),
      filter_(*LoadTorqueFilter::make(config.filter)),
      air_(*AirCut::make(config.air)),
      inertia_(*RunUpInertia::make(config.inertia)),
      meter_(*PowerScale::make(config.meter)),
      noise_({.sample_period_s = config.flux.sample_period_s,
              .rated_torque_nm = config.filter.rated_torque_nm,
              .sensorless = config.sensorless}),
      resistance_(*StatorResistance::make(config.resistance)) {
  const float least_flux = kLeastFlux_ratio * config.rated_flux_v_s;
  const float model = kModel_ratio * config.filter.rated_torque_nm;
  settings_ = {
      .sample_period_s = config.flux.sample_period_s,
      .pole_pairs = config.flux.pole_pairs,
      .leakage_inductance_h = config.leakage_inductance_h,
      .least_flux_squared = least_flux * least_flux,
      .copper_loss_ohm = 1.5F * config.flux.stator_resistance_ohm,
      .slip_ohm = 2.0F * config.resistance.rotor_resistance_ohm / (3.0F * config.flux.pole_pairs),
      .rated_torque_nm = config.filter.rated_torque_nm,
      .model_variance_nm2 = model * model,
      .usual_ohm = kUsualResistance_ratio * config.flux.stator_resistance_ohm,
      .speed_delay_ticks = config.speed_delay_ticks,
      .sensorless = config.sensorless ? 1U : 0U,
      .tracks_resistance = config.track_resistance && !config.sensorless ? 1U : 0U};
  tick_.calibrated = config.calibrate ? 0U : 1U;
}

static_assert(std::is_trivially_copyable_v<FusedObserver>);

}  // namespace cutforce::estimator
