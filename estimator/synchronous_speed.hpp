// Synchronous speed of an induction motor, from its voltages and currents alone.
//   w_e = sum of the angles between successive vectors / window time            (E26)
//   w_s = w_e / p                                                               (E27)
// The vector is the line current, or the rotor flux
//   psi' = v - R_s i - lambda psi (trapezoidal rule),  psi_R = psi - L_sigma i  (E28)
// whose angle does not jump with the load. The leak lambda forgets the starting value; it turns
// and shrinks a steady flux, which does not change its rotation, and the shrinkage is undone in
// the published size.
// From slip instead, with the rotor's resistance R_R and the rotor speed w_M:
//   w_s = (w_M + sqrt(w_M^2 + 4 k P_g))/2,  k = 2 R_R/(3 p^2 |psi_R|^2)         (E29)
// All quantities star-equivalent, inverse-Gamma model (R_R, L_sigma on the stator side).
#pragma once

#include <cmath>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <type_traits>

#include "estimator/polynomials.hpp"
#include "estimator/space_vector.hpp"

namespace cutforce::estimator {

// (E29); all in SI, flux_square_v2s2 = |psi_R|^2 > 0, pole_pairs > 0. Signs: a motor that turns
// backwards has negative speeds and a positive power.
[[nodiscard]] inline float synchronous_speed_from_slip(float rotor_speed_rad_s,
                                                       float airgap_power_w,
                                                       float rotor_resistance_ohm, float pole_pairs,
                                                       float flux_square_v2s2) noexcept {
  const float size = magnitude(rotor_speed_rad_s);
  const float k = rotor_resistance_ohm / (1.5F * pole_pairs * pole_pairs * flux_square_v2s2);
  const float under = size * size + 4.0F * k * airgap_power_w;
  const float speed = 0.5F * (size + std::sqrt(under > 0.0F ? under : 0.0F));
  return rotor_speed_rad_s < 0.0F ? -speed : speed;
}

class SynchronousSpeed {
 public:
  enum class Vector : std::uint8_t { kCurrent, kFlux };
  enum class ConfigError : std::uint8_t {
    kSamplePeriod,
    kWindow,
    kPolePairs,
    kMotor,
    kLeak,
    kLimits,
  };

  struct Config {
    float sample_period_s;
    std::uint32_t samples_per_window;
    Vector vector;
    float pole_pairs;
    float stator_resistance_ohm;
    float leakage_inductance_h;      // 0: the stator flux is taken for the rotor flux
    float flux_leak_rad_s;           // lambda
    float minimum_current_a;         // root mean square of |i| below which nothing is valid
    float minimum_electrical_rad_s;  // below it nothing is valid

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(sample_period_s > 0.0F && sample_period_s <= 1.0F)) {
        return std::unexpected{ConfigError::kSamplePeriod};
      }
      if (samples_per_window < 5 || samples_per_window > 1000000) {
        return std::unexpected{ConfigError::kWindow};
      }
      if (!(pole_pairs >= 1.0F && pole_pairs < 100.0F)) {
        return std::unexpected{ConfigError::kPolePairs};
      }
      if (!(stator_resistance_ohm >= 0.0F && stator_resistance_ohm < 1e4F &&
            leakage_inductance_h >= 0.0F && leakage_inductance_h <= 10.0F)) {
        return std::unexpected{ConfigError::kMotor};
      }
      if (!(flux_leak_rad_s > 0.0F && flux_leak_rad_s * sample_period_s < 1.0F)) {
        return std::unexpected{ConfigError::kLeak};
      }
      if (!(minimum_current_a >= 0.0F && minimum_electrical_rad_s > 0.0F)) {
        return std::unexpected{ConfigError::kLimits};
      }
      return {};
    }
  };

  struct Output {
    float electrical_rad_s;       // stator frequency, mean over the window
    float synchronous_rad_s;      // the same at the shaft, w_s
    float synchronous_end_rad_s;  // mean over the last fifth of the window: its end, for inertia
    float flux_square_v2s2;       // |psi_R|^2, mean over the window
    bool valid;
  };

  struct State {
    SpaceVector flux_vs{0.0F, 0.0F};  // stator flux
    SpaceVector emf_v{0.0F, 0.0F};    // of the sample before
    SpaceVector vector{0.0F, 0.0F};   // whose rotation is counted, of the sample before
    float angle_rad = 0.0F;           // sums over the window so far
    float angle_end_rad = 0.0F;
    float flux_square_v2s2 = 0.0F;
    float current_square_a2 = 0.0F;
    std::uint32_t sample = 0;
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<SynchronousSpeed, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return SynchronousSpeed{config};
  }

  // One raw sample; an output with the last sample of each window. Needs at least three samples
  // to an electrical period.
  [[nodiscard]] std::optional<Output> step(const MotorSample& sample) noexcept {
    if (!add(sample)) return std::nullopt;
    return close_window();
  }
  // The same in two parts: true with the last sample of a window, which close_window() then ends.
  [[nodiscard]] bool add(const MotorSample& sample) noexcept { return add_run({&sample, 1}); }
  // Samples of one window.
  [[nodiscard]] bool add_run(std::span<const MotorSample> samples) noexcept;
  [[nodiscard]] [[gnu::always_inline]] Output close_window() noexcept;

  // Drops the window and the flux so far. For gaps in the signals.
  constexpr void restart() noexcept { state_ = {}; }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  explicit constexpr SynchronousSpeed(const Config& config) noexcept
      : config_(config),
        flux_keep_((1.0F - 0.5F * config.flux_leak_rad_s * config.sample_period_s) /
                   (1.0F + 0.5F * config.flux_leak_rad_s * config.sample_period_s)),
        flux_gain_s_(0.5F * config.sample_period_s /
                     (1.0F + 0.5F * config.flux_leak_rad_s * config.sample_period_s)),
        end_samples_(config.samples_per_window / 5),
        count_(static_cast<float>(config.samples_per_window)),
        window_s_(count_ * config.sample_period_s),
        end_pole_pairs_s_(static_cast<float>(end_samples_) * config.sample_period_s *
                          config.pole_pairs),
        least_square_a2_(count_ * config.minimum_current_a * config.minimum_current_a) {}

  Config config_;
  float flux_keep_;
  float flux_gain_s_;
  std::uint32_t end_samples_;
  // Of a window: samples, length, length of its end times pole pairs, least sum of |i|^2.
  float count_;
  float window_s_;
  float end_pole_pairs_s_;
  float least_square_a2_;
  State state_{};
};

inline auto SynchronousSpeed::close_window() noexcept -> Output {
  const float electrical = state_.angle_rad / window_s_;  // (E26)
  const bool valid = magnitude(electrical) >= config_.minimum_electrical_rad_s &&
                     state_.current_square_a2 >= least_square_a2_;
  const float leak = valid ? config_.flux_leak_rad_s / electrical : 0.0F;
  const Output output{.electrical_rad_s = electrical,
                      .synchronous_rad_s = electrical / config_.pole_pairs,  // (E27)
                      .synchronous_end_rad_s = state_.angle_end_rad / end_pole_pairs_s_,
                      .flux_square_v2s2 = state_.flux_square_v2s2 / count_ * (1.0F + leak * leak),
                      .valid = valid};
  state_.angle_rad = 0.0F;
  state_.angle_end_rad = 0.0F;
  state_.flux_square_v2s2 = 0.0F;
  state_.current_square_a2 = 0.0F;
  state_.sample = 0;
  return output;
}

static_assert(std::is_trivially_copyable_v<SynchronousSpeed>);

}  // namespace cutforce::estimator
