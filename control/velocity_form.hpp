// PI in velocity form around the override that really acted, for every law that is one at heart:
// (C1)-(C4).
//
//   U_b(i-1) = U(i-1) moved to within the rounding of the override that acted
//   U(i)     = U_b(i-1) + (Kp + Ki T) E(i) - Kp E(i-1)
//
// U_b is the whole anti-windup, and the bumpless switching too: a law that is not in charge
// follows. Only increments depend on the gains, so that they may change from tick to tick without
// a jump of U.
#pragma once

#include <algorithm>

#include "control/law.hpp"

namespace cutforce::control {

struct VelocityGains {
  float proportional_pct_n;  // Kp
  float integral_pct_n;      // Ki T
  float tracking_ratio;      // T / T_t; 1 is the velocity form, less the position form of (C4)
};

inline constexpr float kFarPct = 1e4F;  // far beyond every limit, and finite
inline constexpr float kFarN = 1e9F;    // and far beyond every force

// std::clamp(x, -most, most), told by one comparison where there is nothing to do.
[[nodiscard]] constexpr float within(float x, float most) noexcept {
  return __builtin_fabsf(x) <= most ? x : std::clamp(x, -most, most);
}

// The law's answer to one tick. `State` keeps wanted_pct, U(i-1), and error_n, E(i-1).
template <class State>
[[nodiscard]] constexpr float velocity_form_pct(State& state, const LawInput& input,
                                                const VelocityGains& gains) noexcept {
  const float error_n = within(input.force_reference_n - input.force_n, kFarN);  // (C1)
  const float base_pct =
      std::clamp(state.wanted_pct, input.override_applied_pct - input.override_tolerance_pct,
                 input.override_applied_pct + input.override_tolerance_pct);  // (C2)
  switch (input.mode) {
    case LawMode::kActive: {
      // (C3), (C4) in one: I(i-1) = U(i-1) - Kp E(i-1) needs no state of its own.
      const float before_pct =
          state.wanted_pct + gains.tracking_ratio * (base_pct - state.wanted_pct);
      const float wanted_pct = before_pct + gains.proportional_pct_n * (error_n - state.error_n) +
                               gains.integral_pct_n * error_n;
      state.wanted_pct = within(wanted_pct, kFarPct);
      state.error_n = error_n;
      return state.wanted_pct;
    }
    case LawMode::kTrack:
      state.error_n = error_n;
      break;
    case LawMode::kHold:
      break;
  }
  // Following: P1 (4) from here with E(i-1) = E(i) moves by the integral part alone.
  state.wanted_pct = base_pct;
  return input.override_applied_pct;
}

}  // namespace cutforce::control
