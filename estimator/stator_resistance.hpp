// Stator resistance on line, from the consistency of slip and torque.
//
//   |psi_R|^2 w_sl = A T - (A dR) x - A T_fe w_e/w_n,   x = 1.5 |i|^2 p / w_e,
//   A = R_R / (1.5 p)                                                                       (E110)
// with w_sl = mean(w_psi) - p mean(w), T the torque computed with the resistance in use, dR the
// true resistance less that, T_fe the torque of the iron loss at rated frequency w_n. Means of 50
// ms while torque and speed stand still. Torque is the instrument, slip the measurement: slip is
// the noisy quantity. Three states (A, A dR, A T_fe) in a Kalman filter without process noise but
// slow forgetting of dR (temperature). The torque is corrected by
//   T' = T - dR (x - x_tare)                                                                (E111)
// only, so that the tare keeps continuity. Where the copper term is smaller than what the iron
// loss may be, the value found is kept and nothing is learned.
// Source: ESTIMATOR prototype 1.5; derivation in EQUATIONS.md.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {

class StatorResistance {
 public:
  enum class ConfigError : std::uint8_t { kMotor, kUncertainty };

  struct Config {
    float pole_pairs;
    float stator_resistance_ohm;  // in use, star-equivalent
    float resistance_sigma_ratio;
    float rotor_resistance_ohm;
    float rotor_sigma_ratio;
    float rated_torque_nm;
    float rated_frequency_rad_s;
    float iron_torque_nm;        // what is declared, at rated frequency
    float iron_torque_sigma_nm;  // small where the iron loss is declared

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(pole_pairs >= 1.0F && stator_resistance_ohm > 0.0F && rotor_resistance_ohm > 0.0F &&
            rated_torque_nm > 0.0F && rated_frequency_rad_s > 0.0F))
        return std::unexpected{ConfigError::kMotor};
      if (!(resistance_sigma_ratio > 0.0F && rotor_sigma_ratio > 0.0F &&
            iron_torque_sigma_nm > 0.0F))
        return std::unexpected{ConfigError::kUncertainty};
      return {};
    }
  };

  struct Input {
    float flux_squared;          // |psi_R|^2 with the resistance in use
    float flux_frequency_rad_s;  // of this tick
    float speed_rad_s;           // measured, mechanical
    float frequency_rad_s;       // smoothed w_e
    float torque_nm;
    float current_squared_a2;
    float idle_copper_nm_ohm;  // x of the idle: without it in view A and dR cannot be told apart
    float duration_s;
    bool steady;
  };

  struct State {
    std::array<float, 3> mean{};
    std::array<float, 6> covariance{};  // 00 01 02 11 12 22
    std::array<float, 6> sums{};        // flux2, slip, torque, x, w_e, time
    float first_torque_nm = 0.0F;
    float last_rest = 0.0F;    // what the block before left unexplained
    float scatter = 0.0F;      // variance of a block, from the changes of that
    std::uint32_t blocks = 0;  // in a row
  };

  [[nodiscard]] static constexpr std::expected<StatorResistance, ConfigError> make(
      const Config& config) noexcept;
  void step(const Input& input) noexcept;
  // Whether the copper term of the idle stands out of what the iron loss may be; else step() is
  // pause().
  [[nodiscard]] bool stands_out(float idle_copper_nm_ohm, float frequency_rad_s) const noexcept {
    return magnitude(idle_copper_nm_ohm) > least_copper_ * magnitude(frequency_rad_s);
  }
  [[gnu::always_inline]] void pause() noexcept {
    if (state_.sums[5] != 0.0F || state_.blocks != 0) [[unlikely]]
      forget();
  }

  // Found anew with each block only, asked for several times a tick.
  [[nodiscard]] float change_ohm() const noexcept { return change_ohm_; }  // within -50 and +100 %
  [[nodiscard]] float change_sigma_ohm() const noexcept { return change_sigma_ohm_; }

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept {
    state_ = state;
    find_change();
  }

 private:
  static constexpr float kLargestRise_ratio = 1.0F;  // of the resistance in use
  static constexpr float kLargestFall_ratio = 0.5F;

  static constexpr float kStandsOut_sigmas = 1.6F;

  explicit constexpr StatorResistance(const Config& config) noexcept;
  void forget() noexcept {
    state_.sums.fill(0.0F);
    state_.blocks = 0;
  }
  void learn() noexcept;
  constexpr void find_change() noexcept;

  float change_ohm_ = 0.0F;  // dR
  float change_sigma_ohm_ = 0.0F;
  float least_copper_;  // over the frequency
  State state_{};
  Config config_;
};

constexpr auto StatorResistance::make(const Config& config) noexcept
    -> std::expected<StatorResistance, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return StatorResistance{config};
}

constexpr StatorResistance::StatorResistance(const Config& config) noexcept
    : least_copper_(kStandsOut_sigmas * config.iron_torque_sigma_nm /
                    (config.rated_frequency_rad_s * config.resistance_sigma_ratio *
                     config.stator_resistance_ohm)),
      config_(config) {
  const float a = config.rotor_resistance_ohm / (1.5F * config.pole_pairs);
  const float sa = config.rotor_sigma_ratio * a;
  const float sr = a * config.resistance_sigma_ratio * config.stator_resistance_ohm;
  const float sf = a * config.iron_torque_sigma_nm;
  state_.mean = {a, 0.0F, a * config.iron_torque_nm};
  state_.covariance = {sa * sa, 0.0F, 0.0F, sr * sr, 0.0F, sf * sf};
  find_change();
}

constexpr void StatorResistance::find_change() noexcept {
  const float a = state_.mean[0];
  if (!(a > 0.0F)) {
    change_ohm_ = 0.0F;
    change_sigma_ohm_ = config_.resistance_sigma_ratio * config_.stator_resistance_ohm;
    return;
  }
  const float change = state_.mean[1] / a;
  const float most = kLargestRise_ratio * config_.stator_resistance_ohm;
  const float least = -kLargestFall_ratio * config_.stator_resistance_ohm;
  change_ohm_ = change > most ? most : (change < least ? least : change);
  change_sigma_ohm_ = std::sqrt(state_.covariance[3]) / a;
}

static_assert(std::is_trivially_copyable_v<StatorResistance>);

}  // namespace cutforce::estimator
