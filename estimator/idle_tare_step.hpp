// One window of IdleTare, for TorquePath to inline into its own; everyone else calls step(). What
// an idle window alone needs stays a call, in idle_tare.cpp.
#pragma once

#include <algorithm>
#include <cmath>

#include "estimator/idle_tare.hpp"

namespace cutforce::estimator {

[[gnu::always_inline]] inline auto IdleTare::recent_mean() const noexcept -> float {
  return 0.25F * ((state_.recent_nm[0] + state_.recent_nm[1]) +
                  (state_.recent_nm[2] + state_.recent_nm[3]));
}

// Keeps the account of how long speed and torque have been at rest.
[[gnu::always_inline]] inline void IdleTare::rest(const Input& input) noexcept {
  const bool steady = std::abs(input.speed_rad_s - state_.speed_rad_s) <= config_.steady_rad_s;
  state_.speed_rad_s = input.speed_rad_s;
  state_.steady_windows = steady ? state_.steady_windows + 1 : 0;
  const float torque = input.load_torque_nm;
  if (!steady || state_.recent == 0 || !(std::abs(torque - state_.rest_torque_nm) <= band_nm_)) {
    state_.rest_windows = 0;
    state_.recent = 0;
    state_.rest_torque_nm = torque;
  } else {
    ++state_.rest_windows;
    const float count = std::min(static_cast<float>(state_.rest_windows) + 1.0F, kRestMemory);
    state_.rest_torque_nm += (torque - state_.rest_torque_nm) / count;
  }
  state_.recent_nm[state_.recent % 4] = torque;
  ++state_.recent;
}

[[gnu::always_inline]] inline void IdleTare::enter_cut(float above_idle_nm) noexcept {
  state_.mode = Mode::kCut;
  state_.highest_nm = above_idle_nm;
}

[[gnu::always_inline]] inline void IdleTare::decide_alone(const Input& input) noexcept {
  const float idle = idle_torque(input.speed_rad_s);
  const float above = state_.recent >= 4 ? recent_mean() - idle : input.load_torque_nm - idle;
  const bool resting = state_.rest_windows >= wait_windows_;
  const float rest_above = state_.rest_torque_nm - idle;
  switch (state_.mode) {
    case Mode::kSearching:
      if (resting && rest_above <= reach(input.speed_rad_s)) {
        state_.mode = Mode::kIdle;
      } else if (state_.steady_windows >= wait_windows_ && touches(input)) {
        enter_cut(above);
      }
      return;
    case Mode::kIdle:
      if (touches(input)) enter_cut(input.load_torque_nm - idle);
      return;
    case Mode::kCut:
      state_.highest_nm = std::max(state_.highest_nm, above);
      if (resting && rest_above <= 0.5F * state_.highest_nm &&
          rest_above <= reach(input.speed_rad_s)) {
        state_.mode = Mode::kIdle;
      }
      return;
  }
}

[[gnu::always_inline]] inline void IdleTare::decide(const Input& input) noexcept {
  switch (input.feed) {
    case Feed::kAir:
      state_.mode = Mode::kIdle;
      return;
    case Feed::kCut:
      if (state_.mode != Mode::kCut) enter_cut(0.0F);
      return;
    case Feed::kUnknown:
      decide_alone(input);
      return;
  }
}

[[gnu::always_inline]] inline auto IdleTare::publish(const Input& input, bool taring) const noexcept
    -> Output {
  const bool acquired = state_.acquired != 0;
  const float moved =
      config_.viscous_sigma_nm_s_rad * (input.speed_rad_s - state_.tare_speed_rad_s);
  const float variance = state_.noise_variance_nm2 * gain_ +
                         config_.aging_nm_sqrt_s * config_.aging_nm_sqrt_s * state_.age_s +
                         moved * moved;  // (E46)
  return {.coulomb_nm = state_.coulomb_nm,
          .viscous_nm_s_rad = state_.viscous_nm_s_rad,
          .idle_torque_nm = idle_torque(input.speed_rad_s),
          .sigma_nm = acquired ? std::sqrt(variance) : config_.idle_sigma_nm,
          .noise_sigma_nm = acquired ? noise_sigma_nm_ : 0.0F,
          .age_s = state_.age_s,
          .in_cut = state_.mode == Mode::kCut,
          .taring = taring,
          .acquired = acquired};
}

[[gnu::always_inline]] inline auto IdleTare::step_inlined(const Input& input) noexcept -> Output {
  state_.age_s += config_.period_s;
  bool taring = false;
  if (!input.valid) [[unlikely]] {
    state_.rest_windows = 0;
    state_.recent = 0;
  } else if (!(input.speed_rad_s >= config_.minimum_speed_rad_s)) [[unlikely]] {
    stand_still();
  } else {
    rest(input);
    decide(input);
    taring = state_.mode == Mode::kIdle && state_.rest_windows >= wait_windows_;
    if (taring) {
      tare(input);
    } else if (state_.idle_windows != 0) [[unlikely]] {
      close_idle();
    }
  }
  return publish(input, taring);
}

}  // namespace cutforce::estimator
