// Cutting torque from phase voltages and currents, speed and their noise, fused.
//
// Composition, once a raw sample: FluxTorque (air-gap torque). Once a tick (1 ms):
//   frequency:  psi_R = psi - L_sigma i;  w_psi = arg(psi_R conj psi_R,prev)/h, w_i likewise   (E100)
//               w_e += (1 - exp(-h/15 ms)) (w_x - w_e), w_x = w_psi once it agrees, else w_i    (E101)
//   speed:      measured, or without a sensor (w_psi - w_sl)/p, w_sl = 2 R_R T_m/(3 p |psi_R|^2) (E102)
//   noise:      of speed and torque, measured in idle                                            (E103)
//   load:       LoadTorqueFilter;  air, cut and tare: AirCut
//   sigma:      (E104)
// Source: ESTIMATOR prototype 1.2, 1.3; changes and derivations: EQUATIONS.md.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "estimator/air_cut.hpp"
#include "estimator/flux_torque.hpp"
#include "estimator/load_torque_filter.hpp"
#include "estimator/space_vector.hpp"

namespace cutforce::estimator {

class FusedObserver {
 public:
  enum class ConfigError : std::uint8_t { kFlux, kFilter, kAir, kMotor };

  struct Config {
    FluxTorque::Config flux;
    LoadTorqueFilter::Config filter;
    AirCut::Config air;
    float rotor_resistance_ohm;     // star-equivalent, inverse-gamma
    float leakage_inductance_h;     // star-equivalent, inverse-gamma
    float rated_flux_v_s;           // about; decides only what is plausible
    float inertia_sigma_ratio;
    float stator_resistance_sigma_ohm;
    bool sensorless;                // speed from the flux

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!flux.check()) return std::unexpected{ConfigError::kFlux};
      if (!filter.check()) return std::unexpected{ConfigError::kFilter};
      if (!air.check()) return std::unexpected{ConfigError::kAir};
      if (!(rotor_resistance_ohm > 0.0F && leakage_inductance_h >= 0.0F && rated_flux_v_s > 0.0F))
        return std::unexpected{ConfigError::kMotor};
      if (!(inertia_sigma_ratio >= 0.0F && stator_resistance_sigma_ohm >= 0.0F))
        return std::unexpected{ConfigError::kMotor};
      return {};
    }
  };

  struct Sample {
    MotorSample motor;
    float speed_rad_s;
    float elapsed_periods;
    bool speed_valid;
  };

  struct Output {
    bool valid;                    // an estimate exists
    bool steady;                   // speed and torque stand still: offsets can be measured
    bool calibrated;
    AirCut::Phase phase;
    float airgap_power_w;
    float airgap_torque_nm;        // mean of the tick
    float load_torque_nm;          // after inertia
    float net_torque_nm;           // less nominal friction and tare: T_C + load friction
    float net_sigma_nm;
    float speed_rad_s;
    float frequency_rad_s;         // electrical
    float tare_nm;
    float tare_age_s;
    float idle_s;                  // time in this idle
    float duration_s;
  };

  struct Noise {
    LoadTorqueFilter::Noise filter{};
    std::array<float, 3> torque_nm{};        // last ticks, for differences
    std::array<float, 2> unexplained_nm{};
    float explained_rad_s = 0.0F;            // speed that the torque explains
    float residual_rad_s = 0.0F;             // the rest
    float step_rad_s = 0.0F;                 // its last change
    float last_speed_rad_s = 0.0F;
    float last_moment_nm = 0.0F;
    float slow_torque_nm = 0.0F;
    float e0 = 0.0F;                         // variance of the changes of the rest
    float e1 = 0.0F;                         // and their covariance from tick to tick
    float c0 = 0.0F;                         // variance of the rest in a long idle
    float third_torque = 0.0F;
    float second_unexplained = 0.0F;
    float seen_s = 0.0F;                     // in this average
    float idle_s = 0.0F;
    std::uint32_t measured = 0;
    std::uint32_t idle_measured = 0;
  };

  struct State {
    FluxTorque::State flux;
    LoadTorqueFilter::State filter;
    AirCut::State air;
    Noise noise{};
    SpaceVector rotor_flux_v_s{};
    SpaceVector current_a{};
    float frequency_rad_s = 0.0F;
    float locked_s = 0.0F;
    float speed_sum_rad_s = 0.0F;
    std::uint32_t speed_count = 0;
    float load_torque_nm = 0.0F;
    float idle_current_a2 = 0.0F;
    std::uint32_t ticks = 0;
    std::uint32_t calibrated = 0;
  };

  [[nodiscard]] static std::expected<FusedObserver, ConfigError> make(const Config& config) noexcept;

  void step(const Sample& sample) noexcept;
  [[nodiscard]] Output tick(AirCut::Feed feed) noexcept;

  // Voltages and currents to come are corrected by these offsets (idle calibration).
  void recalibrated(SpaceVector voltage_offset_v, SpaceVector current_offset_a) noexcept;

  [[nodiscard]] State state() const noexcept;
  void restore(const State& state) noexcept;

 private:
  FusedObserver(const Config& config, const FluxTorque& flux, const LoadTorqueFilter& filter,
                const AirCut& air) noexcept;
  struct Rotation {
    float flux_rad_s;
    float current_rad_s;
    float flux_squared;
  };
  [[nodiscard]] Rotation rotation(const FluxTorque::Window& window) noexcept;
  void track_frequency(const Rotation& rotation, float duration_s) noexcept;
  void measure_noise(const LoadTorqueFilter::Input& input, float centre_ratio, bool idle) noexcept;

  Config config_;
  FluxTorque flux_;
  LoadTorqueFilter filter_;
  AirCut air_;
  State own_{};  // the parts' own states are kept in the parts
};

static_assert(std::is_trivially_copyable_v<FusedObserver>);

}  // namespace cutforce::estimator
