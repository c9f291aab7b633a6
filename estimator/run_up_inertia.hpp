// Inertia from the run-up, and from every later change of speed between two air cuts.
//
//   J = integral(T - T_C - B w - b) dt / (w_end - w_start)                                  (E115)
// over the time between two idles, once the tare b is known, then combined with what was known:
// J' = J + k (J_seen - J), k = s_J^2 / (s_J^2 + s^2), s^2 = (error of T)^2 + (error of b t/dw)^2.
// A cut in between discards the episode. Only over a change of speed worth measuring, and never
// further than two sigmas from the value given. Source: the integral of P3 (5); weights:
// EQUATIONS.md.
#pragma once

#include <cstdint>
#include <expected>
#include <type_traits>

namespace cutforce::estimator {

class RunUpInertia {
 public:
  enum class ConfigError : std::uint8_t { kInertia, kFriction };

  struct Config {
    float inertia_kg_m2;
    float inertia_sigma_ratio;  // of the value given
    float coulomb_torque_nm;
    float viscous_nm_s_rad;
    float rated_torque_nm;
    float rated_speed_rad_s;  // about: below it channel offsets weigh the more

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(inertia_kg_m2 > 0.0F && inertia_sigma_ratio >= 0.0F && rated_torque_nm > 0.0F &&
            rated_speed_rad_s > 0.0F))
        return std::unexpected{ConfigError::kInertia};
      if (!(coulomb_torque_nm >= 0.0F && viscous_nm_s_rad >= 0.0F))
        return std::unexpected{ConfigError::kFriction};
      return {};
    }
  };

  struct Input {
    float torque_nm;    // mean of the tick
    float speed_rad_s;  // end of the tick, filtered
    float duration_s;
    bool valid;   // torque and speed can be told
    bool idle;    // in the air, with a tare that has been averaged: an episode ends here
    bool in_cut;  // an episode that holds a cut is worth nothing
    float tare_nm;
    bool calibrated;  // channel offsets are known
  };

  struct State {
    float impulse_nm_s = 0.0F;  // of the torque less nominal friction
    float gained_rad_s = 0.0F;
    float time_s = 0.0F;
    float turned_rad = 0.0F;       // in this episode
    std::uint32_t calibrated = 1;  // all through it
    float last_speed_rad_s = 0.0F;
    float inertia_kg_m2 = 0.0F;
    float sigma_ratio = 0.0F;
    std::uint32_t seen = 0;
  };

  [[nodiscard]] static constexpr std::expected<RunUpInertia, ConfigError> make(
      const Config& config) noexcept;
  // In the cut there is nothing to do, in idle only the speed to keep.
  [[gnu::always_inline]] void step(const Input& in) noexcept {
    State& s = state_;
    if (!in.valid || in.in_cut) {
      lose();
      return;
    }
    if (in.idle) {
      if (s.time_s > 0.0F) [[unlikely]]
        close(in.tare_nm);
    } else if (s.seen != 0) {
      gather(in.torque_nm, in.speed_rad_s, in.duration_s, in.calibrated);
    }
    s.seen = 1;
    s.last_speed_rad_s = in.speed_rad_s;
  }

  // The episode is worth nothing.
  [[gnu::always_inline]] void lose() noexcept {
    if (state_.seen == 0) return;
    state_.seen = 0;
    forget_episode();
  }

  [[nodiscard]] float inertia_kg_m2() const noexcept { return state_.inertia_kg_m2; }
  [[nodiscard]] float sigma_ratio() const noexcept { return state_.sigma_ratio; }
  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  explicit constexpr RunUpInertia(const Config& config) noexcept;
  void gather(float torque_nm, float speed_rad_s, float duration_s, bool calibrated) noexcept;
  void close(float tare_nm) noexcept;
  void find(float tare_nm) noexcept;
  void forget_episode() noexcept;

  State state_{};
  Config config_;
};

constexpr auto RunUpInertia::make(const Config& config) noexcept
    -> std::expected<RunUpInertia, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return RunUpInertia{config};
}

constexpr RunUpInertia::RunUpInertia(const Config& config) noexcept : config_(config) {
  state_.inertia_kg_m2 = config.inertia_kg_m2;
  state_.sigma_ratio = config.inertia_sigma_ratio;
}

static_assert(std::is_trivially_copyable_v<RunUpInertia>);

}  // namespace cutforce::estimator
