// Tells air from cut, and keeps the no-load torque of the air cut just before contact (tare).
//
//   y    = (tau - T_C sgn(w) - B w) sgn(w)           load torque less nominal friction    (E90)
//   b   += (y - b) / (P W),  W = (1 - h/0.3 s) W + 1/P   while idle, frozen in the cut     (E91)
//   contact:  y - b > max(4 sigma, 1.5 % T_n)        and the motor is not braking          (E92)
// On contact the tare returns to its value of about 0.1 s before, so that the start of a slow
// entry is not taken for friction. A change of speed is neither air nor cut: while it lasts
// nothing is tared, and contact is told from an inertia error by the sign of the acceleration.
// If the CNC says whether it feeds, that is used instead of the amplitude.
// A steady load below the threshold cannot be told from friction without that signal.
// Source: ESTIMATOR prototype 1.3; states, snapshot and speed change: EQUATIONS.md.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <type_traits>

namespace cutforce::estimator {

class AirCut {
 public:
  enum class ConfigError : std::uint8_t { kTorque, kInertia, kFriction };
  enum class Phase : std::uint32_t { kUnsteady, kIdle, kCut };
  enum class Feed : std::uint8_t { kUnknown, kIdle, kActive };

  struct Config {
    float rated_torque_nm;
    float inertia_kg_m2;
    float coulomb_torque_nm;
    float viscous_nm_s_rad;
    float contact_ratio;         // of the rated torque, 0.015
    float friction_limit_ratio;  // the first idle is believed up to this deviation from nominal

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(rated_torque_nm > 0.0F)) return std::unexpected{ConfigError::kTorque};
      if (!(inertia_kg_m2 > 0.0F)) return std::unexpected{ConfigError::kInertia};
      if (!(coulomb_torque_nm >= 0.0F && viscous_nm_s_rad >= 0.0F))
        return std::unexpected{ConfigError::kFriction};
      if (!(contact_ratio > 0.0F && friction_limit_ratio > contact_ratio))
        return std::unexpected{ConfigError::kTorque};
      return {};
    }
  };

  struct Input {
    float load_torque_nm;
    float sigma_nm;        // of the load torque
    float model_sigma_nm;  // of the torque before any tare: resistance
    float airgap_torque_nm;
    float speed_rad_s;
    float speed_sigma_rad_s;
    float duration_s;
    Feed feed;
    bool calibrated;  // false: the torque still carries the ripple of the channel offsets
    bool valid;       // false: no torque can be told
  };

  struct Output {
    Phase phase;
    bool steady;          // speed steady for the waiting time
    float net_torque_nm;  // (y - b) sgn(w)
    float tare_nm;        // b, in the direction of rotation
    float tare_sigma_nm;
    float idle_variance_nm2;
    float idle_s;      // time in this idle, 0 outside
    float tare_age_s;  // time since the tare was last adjusted
    bool has_tare;
  };

  struct State {
    Phase phase = Phase::kUnsteady;
    std::uint32_t has_tare = 0;
    float slow_speed_rad_s = 0.0F;
    float slower_speed_rad_s = 0.0F;
    float steady_s = 0.0F;  // speed steady, and torque near air
    float even_s = 0.0F;    // speed steady
    float idle_s = 0.0F;
    float tare_weight = 0.0F;
    float tare_nm = 0.0F;
    float tare_age_s = 0.0F;
    float variance_nm2 = 0.0F;
    std::array<float, 4> snapshots_nm{};
    float snapshot_s = 0.0F;
    float slow_net_nm = 0.0F;
    std::uint32_t was_cut = 0;
  };

  [[nodiscard]] static constexpr std::expected<AirCut, ConfigError> make(
      const Config& config) noexcept;
  [[nodiscard]] Output step(const Input& input) noexcept;

  // The torque scale or offset changed by a calibration: average the tare anew.
  void restart_average() noexcept {
    state_.idle_s = 0.0F;
    state_.tare_weight = 0.0F;
  }

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  explicit constexpr AirCut(const Config& config) noexcept : config_(config) {}
  void tare(float y_nm, float variance_nm2, float duration_s) noexcept;
  [[nodiscard]] Phase decide(const Input& input, float y_nm, float slope_nm,
                             float sign) const noexcept;

  Config config_;
  State state_{};
};

constexpr auto AirCut::make(const Config& config) noexcept -> std::expected<AirCut, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return AirCut{config};
}

static_assert(std::is_trivially_copyable_v<AirCut>);

}  // namespace cutforce::estimator
