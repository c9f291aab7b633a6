// Fixed gains, lowered while the process that is seen would make them unstable: (C33)-(C35).
//
//   k_up  = max over the last five ticks in the cut of (F + w sigma) / U_a
//   scale = min(1, (2 / margin) / (k_up (2 Kp + Ki T)))
//
// F(i) = k U(i-1) under PI is stable iff k (2 Kp + Ki T) < 2 and k Kp < 1, (C13); the second
// follows from the first. Scaled, the true gain may be `margin` times k_up before it is not. The
// greatest of five ratios is believed: after a fall of U the force lags and the ratio says too
// much, which is the safe side, and after a rise the four before still speak.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <type_traits>

#include "control/law.hpp"
#include "control/process_gain.hpp"

namespace cutforce::control {

// A record to be kept in a law's State. Nothing is known until the first tick that tells.
struct GainSupervision {
  static constexpr float kMarginRatio = 1.6F;
  static constexpr float kWidening = 2.0F;  // w, in standard deviations of the force

  std::array<float, 5> seen_n_pct{};  // (F + w sigma) / U_a, newest first

  constexpr void observe(const LawInput& input) noexcept {
    if (!tells_process_gain(input)) return;
    const float force_n = input.force_n + kWidening * input.force_sigma_n;
    const float now_n_pct = std::min(force_n / input.override_applied_pct, kFarNPct);
    if (!(highest_n_pct() > 0.0F)) {
      seen_n_pct.fill(now_n_pct);
      return;
    }
    for (std::size_t i = seen_n_pct.size() - 1; i > 0; --i) seen_n_pct[i] = seen_n_pct[i - 1];
    seen_n_pct[0] = now_n_pct;
  }

  // k_up, (C33); 0 before anything is known.
  [[nodiscard]] constexpr float highest_n_pct() const noexcept {
    return *std::max_element(seen_n_pct.begin(), seen_n_pct.end());
  }

  // How much the ratios differ, as a standard deviation over k_up, (C35): five normal deviates
  // span 2.326 of theirs on average.
  [[nodiscard]] constexpr float sigma_ratio() const noexcept {
    const float highest = highest_n_pct();
    if (!(highest > 0.0F)) return 0.0F;
    const float lowest = *std::min_element(seen_n_pct.begin(), seen_n_pct.end());
    return (highest - lowest) / (2.326F * highest);
  }

  // For gains that are stable below the process gain `limit_n_pct`: what is left of them, (C34).
  [[nodiscard]] constexpr float scale_ratio(float limit_n_pct) const noexcept {
    const float allowed_n_pct = limit_n_pct / kMarginRatio;
    const float highest = highest_n_pct();
    return highest > allowed_n_pct ? allowed_n_pct / highest : 1.0F;
  }

  // With those gains left; 0 before anything is known.
  [[nodiscard]] constexpr float margin_ratio(float limit_n_pct) const noexcept {
    const float highest = highest_n_pct();
    return highest > 0.0F ? std::clamp(limit_n_pct / highest, kMarginRatio, 1e6F) : 0.0F;
  }

 private:
  static constexpr float kFarNPct = 1e9F;  // beyond every process, and finite
};

static_assert(std::is_trivially_copyable_v<GainSupervision>);
static_assert(std::is_standard_layout_v<GainSupervision>);
static_assert(sizeof(GainSupervision) == 5 * 4);

}  // namespace cutforce::control
