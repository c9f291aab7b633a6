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

#include "estimator/polynomials.hpp"

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
    float tare_variance_nm2;
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
  [[nodiscard, gnu::always_inline]] Output step(const Input& input) noexcept;

  // The torque scale or offset changed by a calibration: average the tare anew.
  void restart_average() noexcept {
    state_.idle_s = 0.0F;
    state_.tare_weight = 0.0F;
  }

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kUnsteady_ratio = 0.03F;  // of the rated torque, as acceleration torque
  static constexpr float kLargestThreshold_ratio = 0.06F;
  static constexpr float kAging_ratio_sqrt_s = 5e-4F;  // friction drifts between tare and cut
  static constexpr float kUnknownFriction_ratio = 0.05F;
  static constexpr float kBand_ratio = 0.1F;
  static constexpr float kSlopeTime_s = 0.05F;
  static constexpr float kTareTime_s = 0.3F;
  static constexpr float kShortestWait_s = 0.06F;
  static constexpr float kEven_s = 0.02F;

  // What every tick compares with, of the configuration.
  struct Levels {
    float coulomb_nm;
    float viscous_nm_s_rad;
    float steady_rad_s;  // the twice smoothed speed lags by less while the speed is steady
    float band_nm;       // a cut that is this near to air may be its end
    float contact_nm;    // least threshold of (E92)
    float threshold_nm;  // largest
    float aging_nm2_s;
    float unknown_nm2;
  };

  explicit constexpr AirCut(const Config& config) noexcept;
  void tare(float y_nm, float variance_nm2, float duration_s) noexcept;
  void change(Phase now, float y_nm, Feed feed) noexcept;
  [[nodiscard]] Phase decide(const Input& input, float y_nm, float lag_rad_s,
                             float sign) const noexcept;
  [[nodiscard, gnu::always_inline]] Phase decide_quickly(const Input& input, float y_nm,
                                                         float lag_rad_s,
                                                         float sign) const noexcept;
  void follow_phase(const Input& input, float y_nm, float lag_rad_s, float sign,
                    bool steady) noexcept;
  void lose(float speed_rad_s) noexcept;

  State state_{};
  Levels levels_;
  Config config_;
};

constexpr auto AirCut::make(const Config& config) noexcept -> std::expected<AirCut, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return AirCut{config};
}

constexpr AirCut::AirCut(const Config& config) noexcept : config_(config) {
  const float rated = config.rated_torque_nm;
  const float contact = config.contact_ratio * rated;
  const float limit = kLargestThreshold_ratio * rated;
  const float aging = kAging_ratio_sqrt_s * rated;
  const float unknown = kUnknownFriction_ratio * rated;
  levels_ = {.coulomb_nm = config.coulomb_torque_nm,
             .viscous_nm_s_rad = config.viscous_nm_s_rad,
             .steady_rad_s = kUnsteady_ratio * rated * kSlopeTime_s / config.inertia_kg_m2,
             .band_nm = kBand_ratio * rated,
             .contact_nm = contact,
             .threshold_nm = contact > limit ? contact : limit,
             .aging_nm2_s = aging * aging,
             .unknown_nm2 = unknown * unknown};
}

// Nearly always the phase stays what it is, far from any threshold: that needs no root, and gives
// what decide() would.
inline auto AirCut::decide_quickly(const Input& input, float y_nm, float lag_rad_s,
                                   float sign) const noexcept -> Phase {
  if (input.feed == Feed::kUnknown && input.calibrated) [[likely]] {
    if (state_.phase == Phase::kCut) {
      if (state_.steady_s <= kShortestWait_s) return Phase::kCut;
      if (state_.has_tare != 0 && magnitude(state_.slow_net_nm) > levels_.threshold_nm)
        return Phase::kCut;
    } else if (state_.phase == Phase::kIdle) {
      if (magnitude(y_nm - state_.tare_nm) <= levels_.contact_nm) return Phase::kIdle;
    }
  }
  return decide(Input{input}, y_nm, lag_rad_s, sign);
}

[[gnu::always_inline]] inline void AirCut::follow_phase(const Input& input, float y_nm,
                                                        float lag_rad_s, float sign,
                                                        bool steady) noexcept {
  const float h = input.duration_s;
  const bool in_band =
      state_.phase != Phase::kCut || magnitude(y_nm - state_.tare_nm) < levels_.band_nm;
  state_.even_s = steady ? state_.even_s + h : 0.0F;
  state_.steady_s = steady && in_band ? state_.steady_s + h : 0.0F;
  const Phase now = decide_quickly(input, y_nm, lag_rad_s, sign);
  if (now != state_.phase) [[unlikely]]
    change(now, y_nm, input.feed);
  if (now != Phase::kIdle) return;
  if (state_.has_tare == 0) state_.tare_nm = y_nm;
  if (steady) tare(y_nm, input.sigma_nm * input.sigma_nm, h);
}

inline auto AirCut::step(const Input& input) noexcept -> Output {
  const float h = input.duration_s;
  const float w = input.speed_rad_s;
  if (!input.valid) [[unlikely]]
    lose(w);
  const float sign = w > 0.0F ? 1.0F : (w < 0.0F ? -1.0F : 0.0F);
  const float y =
      (input.load_torque_nm - levels_.viscous_nm_s_rad * w) * sign - levels_.coulomb_nm;  // (E90)
  const float share = h < kSlopeTime_s ? h * (1.0F / kSlopeTime_s) : 1.0F;
  const float lag = w - state_.slow_speed_rad_s;
  state_.slow_speed_rad_s += share * lag;
  // Smoothed twice: channel offsets ripple at the electrical frequency until calibrated.
  const float slow_lag = state_.slow_speed_rad_s - state_.slower_speed_rad_s;
  state_.slower_speed_rad_s += share * slow_lag;
  state_.slow_net_nm += share * (y - state_.tare_nm - state_.slow_net_nm);
  if (input.valid) [[likely]]
    follow_phase(input, y, lag, sign, magnitude(slow_lag) < levels_.steady_rad_s);
  state_.tare_age_s += h;

  float tare_variance_nm2 = levels_.unknown_nm2;
  if (state_.has_tare != 0) {
    tare_variance_nm2 = state_.variance_nm2;
    if (state_.idle_s > h)
      tare_variance_nm2 *= h / (state_.idle_s < kTareTime_s ? state_.idle_s : kTareTime_s);
    tare_variance_nm2 += levels_.aging_nm2_s * state_.tare_age_s;
  }
  return {.phase = state_.phase,
          .steady = state_.even_s > kEven_s,
          .net_torque_nm = (y - state_.tare_nm) * sign,
          .tare_nm = state_.tare_nm,
          .tare_variance_nm2 = tare_variance_nm2,
          .idle_variance_nm2 = state_.variance_nm2,
          .idle_s = state_.phase == Phase::kIdle ? state_.idle_s : 0.0F,
          .tare_age_s = state_.tare_age_s,
          .has_tare = state_.has_tare != 0};
}

static_assert(std::is_trivially_copyable_v<AirCut>);

}  // namespace cutforce::estimator
