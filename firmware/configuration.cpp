#include "firmware/configuration.hpp"

#include <cstdint>

#include "firmware/configuration_control.hpp"

namespace cutforce::firmware {
namespace {

using estimator::star_equivalent_resistance;

constexpr float kTwoPi = 6.2831853F;
constexpr float kUsualFluxRatio = 0.9F;  // rotor flux over the flux of the rated voltage

// Uncertainties that no parameter speaks of; relative to the rated torque unless said.
constexpr float kIdleTorqueSigma = 0.03F;
constexpr float kRotorResistanceSigma_ratio = 0.3F;
constexpr float kIronTorqueSigma = 0.015F;  // of an induction motor that nobody measured
constexpr float kDeclaredIronTorqueSigma = 0.003F;
constexpr float kSensorGainSigma_ratio = 0.01F;
constexpr float kMeterSigma_ratio = 0.003F;
constexpr float kMeterImplausible_ratio = 0.05F;
constexpr float kLeastInertiaSigma_ratio = 0.15F;     // a name plate's; the run-up knows better
constexpr float kLeastResistanceSigma_ratio = 0.25F;  // temperature alone moves copper by that

// The part of the machine that the blocks share, derived once.
struct Derived {
  float sample_period_s;
  float resistance_ohm;  // star-equivalent
  float rated_frequency_rad_s;
  float flux_v_s;
  float inertia_sigma_ratio;
  float resistance_sigma_ratio;
  std::uint32_t samples_per_estimate;
  std::uint32_t estimates_per_control;
};

// Nearest whole number, if `ratio` is near one that is at least 1; else 0.
std::uint32_t whole(float ratio) noexcept {
  if (!(ratio > 0.5F && ratio < 1e6F)) return 0;
  const auto nearest = static_cast<std::uint32_t>(ratio + 0.5F);
  const float off = ratio - static_cast<float>(nearest);
  return off < 1e-3F * ratio && off > -1e-3F * ratio ? nearest : 0;
}

std::expected<Derived, ConfigurationError> derive(const Machine& m) noexcept {
  if (!(m.sample_rate_hz > 0.0F)) return std::unexpected{ConfigurationError::kSampleRate};
  if (!(m.pole_pairs >= 1.0F)) return std::unexpected{ConfigurationError::kPolePairs};
  if (!(m.rated_power_w > 0.0F && m.rated_torque_nm > 0.0F && m.rated_frequency_hz > 0.0F &&
        m.rated_voltage_v_rms > 0.0F))
    return std::unexpected{ConfigurationError::kRating};
  Derived d{};
  d.sample_period_s = 1.0F / m.sample_rate_hz;
  d.samples_per_estimate = whole(estimate_period_s(m) * m.sample_rate_hz);
  if (d.samples_per_estimate == 0) return std::unexpected{ConfigurationError::kEstimatePeriod};
  d.estimates_per_control = whole(m.control_period_s / estimate_period_s(m));
  if (d.estimates_per_control == 0) return std::unexpected{ConfigurationError::kControlPeriod};
  d.resistance_ohm = m.winding == Winding::kDelta
                         ? star_equivalent_resistance(m.stator_resistance_ohm)
                         : m.stator_resistance_ohm;
  d.rated_frequency_rad_s = kTwoPi * m.rated_frequency_hz;
  d.flux_v_s = kUsualFluxRatio * 0.8164966F * m.rated_voltage_v_rms / d.rated_frequency_rad_s;
  d.inertia_sigma_ratio = m.inertia_sigma_ratio > kLeastInertiaSigma_ratio
                              ? m.inertia_sigma_ratio
                              : kLeastInertiaSigma_ratio;
  d.resistance_sigma_ratio = m.stator_resistance_sigma_ratio > kLeastResistanceSigma_ratio
                                 ? m.stator_resistance_sigma_ratio
                                 : kLeastResistanceSigma_ratio;
  return d;
}

// With a dynamometer the motor's blocks stand still. They are made for a rate that suits them, not
// for the dynamometer's, which may be one sample a control period.
Derived for_motor(const Machine& m, Derived d) noexcept {
  if (m.estimator != EstimatorName::kDynamometer) return d;
  d.sample_period_s = 1e-3F;
  d.samples_per_estimate = 1;
  d.estimates_per_control = 50;
  return d;
}

estimator::FrontEnd::Config front_end(const Machine& m) noexcept {
  return {.voltages = m.voltage_kind == VoltageKind::kLineToLine
                          ? estimator::VoltageChannels::kLineToLine
                          : estimator::VoltageChannels::kLineToNeutral,
          .currents = m.current_w_present ? estimator::CurrentChannels::kThree
                                          : estimator::CurrentChannels::kTwo,
          .calibration = {.voltage_gain_ratio = m.voltage_gain_ratio,
                          .voltage_offset_v = m.voltage_offset_v,
                          .current_gain_ratio = m.current_gain_ratio,
                          .current_offset_a = m.current_offset_a}};
}

estimator::SampleGate::Config gate(const Machine& m, const Derived& d) noexcept {
  const float shortest_gap_s = 2.5F * d.sample_period_s;
  const float gap_s = m.gap_limit_s < 2.0F ? m.gap_limit_s : 2.0F;
  return {.sample_period_s = d.sample_period_s,
          .voltage_limit_v = m.voltage_limit_v,
          .current_limit_a = m.current_limit_a,
          .speed_limit_rad_s = m.speed_limit_rad_s,
          .power_limit_w = m.power_limit_w,
          .gap_limit_s = gap_s > shortest_gap_s ? gap_s : shortest_gap_s,
          .bridge_limit = 2,
          .clock_limit = 100};
}

estimator::SignalHealth::Config health(const Machine& m, const Derived& d) noexcept {
  return {.sample_period_s = d.sample_period_s,
          .tick_period_s = d.sample_period_s * static_cast<float>(d.samples_per_estimate),
          .voltage_channels = 3,
          .current_channels = m.current_w_present ? 3U : 2U,
          .voltage_range_v = m.voltage_limit_v,
          .current_range_a = m.current_limit_a,
          .voltage_floor_v = 0.01F * m.rated_voltage_v_rms,
          .current_floor_a = 0.05F * m.rated_current_a_rms,
          .minimum_frequency_rad_s = 0.06F * d.rated_frequency_rad_s,
          .rated_frequency_rad_s = d.rated_frequency_rad_s,
          .rated_flux_v_s = d.flux_v_s,
          .stator_resistance_ohm = d.resistance_ohm,
          .hold_s = 0.5F};
}

estimator::FusedObserver::Config fused(const Machine& m, const Derived& d) noexcept {
  const float tick_s = d.sample_period_s * static_cast<float>(d.samples_per_estimate);
  const float iron_nm = m.iron_loss_w * m.pole_pairs / d.rated_frequency_rad_s;
  const float iron_sigma = m.iron_loss_declared ? kDeclaredIronTorqueSigma : kIronTorqueSigma;
  const float delay = m.speed_lag_s / tick_s + 0.5F;
  const bool sensorless = !m.speed_present;
  return {.flux = {.sample_period_s = d.sample_period_s,
                   .pole_pairs = m.pole_pairs,
                   .stator_resistance_ohm = d.resistance_ohm,
                   .leak_ratio = 0.2F},
          .filter = {.tick_s = tick_s,
                     .rated_torque_nm = m.rated_torque_nm,
                     // The flux angle's noise is larger and slower than a sensor's.
                     .edge_slope_1_s = (sensorless ? 0.75F : 1.0F) * m.edge_slope_1_s,
                     .drift_1_sqrt_s = m.drift_1_sqrt_s},
          .air = {.rated_torque_nm = m.rated_torque_nm,
                  .inertia_kg_m2 = m.inertia_kg_m2,
                  .coulomb_torque_nm = m.coulomb_torque_nm,
                  .viscous_nm_s_rad = m.viscous_nm_s_rad,
                  .contact_ratio = 0.015F,
                  .friction_limit_ratio = 0.15F},
          .inertia = {.inertia_kg_m2 = m.inertia_kg_m2,
                      .inertia_sigma_ratio = d.inertia_sigma_ratio,
                      .coulomb_torque_nm = m.coulomb_torque_nm,
                      .viscous_nm_s_rad = m.viscous_nm_s_rad,
                      .rated_torque_nm = m.rated_torque_nm,
                      .rated_speed_rad_s = d.rated_frequency_rad_s / m.pole_pairs},
          .resistance = {.pole_pairs = m.pole_pairs,
                         .stator_resistance_ohm = d.resistance_ohm,
                         .resistance_sigma_ratio = d.resistance_sigma_ratio,
                         .rotor_resistance_ohm = m.rotor_resistance_ohm,
                         .rotor_sigma_ratio = kRotorResistanceSigma_ratio,
                         .rated_torque_nm = m.rated_torque_nm,
                         .rated_frequency_rad_s = d.rated_frequency_rad_s,
                         .iron_torque_nm = iron_nm,
                         .iron_torque_sigma_nm = iron_sigma * m.rated_torque_nm},
          .meter = {.lag_s = m.meter_lag_s > tick_s ? m.meter_lag_s : tick_s,
                    .rated_power_w = m.rated_power_w,
                    .gain_sigma_ratio = kSensorGainSigma_ratio,
                    .meter_sigma_ratio = kMeterSigma_ratio,
                    .implausible_ratio = kMeterImplausible_ratio},
          .leakage_inductance_h = m.leakage_inductance_h,
          .rated_flux_v_s = d.flux_v_s,
          .speed_delay_ticks = delay < 15.0F ? static_cast<std::uint32_t>(delay) : 15U,
          .sensorless = sensorless,
          .track_resistance = true,
          .calibrate = true};
}

estimator::IdleTare::Config idle_tare(const Machine& m, float window_s) noexcept {
  const float rated = m.rated_torque_nm;
  return {.period_s = window_s,
          .coulomb_nm = m.coulomb_torque_nm,
          .viscous_nm_s_rad = m.viscous_nm_s_rad,
          .idle_sigma_nm = kIdleTorqueSigma * rated,
          .viscous_sigma_nm_s_rad =
              m.viscous_nm_s_rad > 0.0F ? m.viscous_nm_s_rad : 0.01F * rated / m.rated_speed_rad_s,
          .inertia_sigma_ratio = m.inertia_sigma_ratio,
          .band_least_nm = 0.003F * rated,
          .band_most_nm = 0.015F * rated,
          .wait_s = 4.0F * window_s,
          .memory_s = 0.3F,
          .drift_nm_s = 0.002F * rated,
          .aging_nm_sqrt_s = 0.0005F * rated,
          .steady_rad_s = 0.002F * m.rated_speed_rad_s,
          .speed_spread_rad_s = 0.06F * m.rated_speed_rad_s,
          .forgetting_ratio = 0.9F,
          .minimum_speed_rad_s = m.minimum_speed_rad_s};
}

estimator::TorquePath::Method method(EstimatorName name) noexcept {
  switch (name) {
    case EstimatorName::kMeasured:
      return estimator::TorquePath::Method::kMeasured;
    case EstimatorName::kComputed:
      return estimator::TorquePath::Method::kComputed;
    case EstimatorName::kSynthesized:
    case EstimatorName::kFused:
    case EstimatorName::kDynamometer:
      break;
  }
  return estimator::TorquePath::Method::kSynthesized;
}

estimator::TorquePath::Speed path_speed(SpeedSource source) noexcept {
  switch (source) {
    case SpeedSource::kSynchronous:
      return estimator::TorquePath::Speed::kSynchronous;
    case SpeedSource::kSlip:
      return estimator::TorquePath::Speed::kSlip;
    case SpeedSource::kRotor:
      break;
  }
  return estimator::TorquePath::Speed::kRotor;
}

estimator::TorquePath::Config torque_path(const Machine& m, const Derived& d) noexcept {
  const std::uint32_t samples = d.samples_per_estimate * d.estimates_per_control;
  const float window_s = d.sample_period_s * static_cast<float>(samples);
  const auto& speeds = m.load_friction_speed_rad_s;
  const float slip = 1.0F - m.rated_speed_rad_s * m.pole_pairs / d.rated_frequency_rad_s;
  return {
      .method = method(m.estimator),
      .speed = path_speed(m.speed_source),
      .power = {.sample_period_s = d.sample_period_s,
                .samples_per_window = samples,
                .stator_resistance_ohm = d.resistance_ohm,
                .mode = m.power_mode == PowerMode::kFixedPowerFactor
                            ? estimator::AirGapPower::Mode::kFixedPowerFactor
                            : estimator::AirGapPower::Mode::kDotProduct,
                .power_factor_ratio = m.fixed_power_factor_ratio,
                .window = estimator::AirGapPower::Window::kTime},
      .synchronous = {.sample_period_s = d.sample_period_s,
                      .samples_per_window = samples,
                      .vector = estimator::SynchronousSpeed::Vector::kFlux,
                      .pole_pairs = m.pole_pairs,
                      .stator_resistance_ohm = d.resistance_ohm,
                      .leakage_inductance_h = m.leakage_inductance_h,
                      .flux_leak_rad_s = 10.0F,
                      .minimum_current_a = 0.02F * m.rated_current_a_rms,
                      .minimum_electrical_rad_s = 0.06F * d.rated_frequency_rad_s},
      .meter = {.period_s = window_s,
                .scale_ratio = m.meter_scale_ratio,
                .offset_w = m.meter_offset_w,
                .efficiency_ratio = m.meter_efficiency_ratio,
                .loss_w = {.speed_rad_s = speeds, .value = {0.0F, 0.0F, 0.0F}},
                .loss_quadratic_1_w = 0.0F,
                .lag_s = m.meter_lag_s,
                .noise_w = m.meter_noise_w,
                .model_sigma_ratio = 0.02F,
                .bias_memory_s = 0.15F,
                .settled_w = 0.036F * m.rated_power_w},
      .drive = {.period_s = window_s, .inertia_kg_m2 = m.inertia_kg_m2},
      .load_friction = {.linear_ratio = {.speed_rad_s = speeds, .value = m.load_friction_ratio},
                        .quadratic_1_nm = {.speed_rad_s = speeds, .value = m.load_friction_1_nm}},
      .tare = idle_tare(m, window_s),
      .monitor = {.period_s = window_s,
                  .mode = m.switch_mode == SwitchMode::kPositiveOnly
                              ? estimator::SynthesizedMonitor::Mode::kPositiveOnly
                              : estimator::SynthesizedMonitor::Mode::kAbsolute,
                  .threshold_ratio = m.switch_threshold_ratio,
                  .hold_s = m.switch_hold_s,
                  .compensation_ratio = m.switch_compensation_ratio,
                  .power_floor_w = m.power_floor_w},
      .rotor_resistance_ohm = m.rotor_resistance_ohm,
      .rated_torque_nm = m.rated_torque_nm,
      .rated_slip_ratio = slip > 0.0F ? slip : 0.0F,
      .stator_resistance_sigma_ratio = m.stator_resistance_sigma_ratio,
      .inertia_sigma_ratio = m.inertia_sigma_ratio,
      .speed_sigma_rad_s = 0.01F,
      .minimum_speed_rad_s = m.minimum_speed_rad_s};
}

}  // namespace

std::expected<void, ConfigurationError> check_loop(const Machine& m) noexcept {
  if (const auto derived = derive(m); !derived) return std::unexpected{derived.error()};
  return {};
}

ControlLoop::Config loop_config(const Machine& m) noexcept {
  const Derived d = *derive(m);
  const Derived motor = for_motor(m, d);
  const std::uint32_t samples = d.samples_per_estimate * d.estimates_per_control;
  return {
      .estimator = m.estimator,
      .control = m.controller != ControllerName::kNone,
      .current_w_present = m.current_w_present,
      .samples_per_estimate = d.samples_per_estimate,
      .estimates_per_control = d.estimates_per_control,
      .fixed_diameter_m = m.workpiece_diameter_m,
      .dynamometer_sigma_n = 0.01F * (m.force_reference_n > 0.0F ? m.force_reference_n : 500.0F),
      .rated_torque_nm = m.rated_torque_nm,
      .voltage_lead_s = m.voltage_lead_s,
      .force_minimum_speed_rad_s = m.minimum_speed_rad_s,
      .programmed_speed_rad_s = m.programmed_speed_rad_s,
      .gate = gate(m, d),
      .front_end = front_end(m),
      .health = health(m, motor),
      .calibration = {.sample_period_s = motor.sample_period_s,
                      .shortest_s = 0.15F,
                      .shortest_periods = 4.0F,
                      .gain_limit_ratio = 0.05F,
                      .three_currents = m.current_w_present},
      .fused = fused(m, motor),
      .path = torque_path(m, motor),
      .load_friction = {.linear_ratio = {.speed_rad_s = m.load_friction_speed_rad_s,
                                         .value = m.load_friction_ratio},
                        .quadratic_1_nm = {.speed_rad_s = m.load_friction_speed_rad_s,
                                           .value = m.load_friction_1_nm}},
      .force = {.gear_ratio = m.gear_ratio,
                .minimum_speed_rad_s = m.minimum_speed_rad_s,
                .diameter_sigma_m = 0.0F},
      .controller = control_path_config(m, d.sample_period_s * static_cast<float>(samples))};
}

std::expected<ControlLoop::Config, ConfigurationError> make_loop_config(const Machine& m) noexcept {
  if (const auto checked = check_loop(m); !checked) return std::unexpected{checked.error()};
  return loop_config(m);
}

std::expected<ControlLoop, ConfigurationFailure> make_loop(const Machine& machine) noexcept {
  const auto config = make_loop_config(machine);
  if (!config) {
    return std::unexpected{
        ConfigurationFailure{config.error(), ControlLoop::ConfigError::kPeriods}};
  }
  const auto loop = ControlLoop::make(*config);
  if (!loop) {
    return std::unexpected{ConfigurationFailure{ConfigurationError::kBlock, loop.error()}};
  }
  return *loop;
}

}  // namespace cutforce::firmware
