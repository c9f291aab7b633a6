#include "estimator/air_gap_power.hpp"

#include <cmath>
#include <numbers>

namespace cutforce::estimator {

auto AirGapPower::skipped_samples(float electrical_rad_s) const noexcept -> float {
  if (config_.window == Window::kTime) return 0.0F;
  const float window = static_cast<float>(config_.samples_per_window);
  const float turns = std::abs(electrical_rad_s) * config_.sample_period_s * window *
                      (0.5F * std::numbers::inv_pi_v<float>);
  // Less than one period fits, or the frequency is no number: the whole window.
  if (!(turns >= 1.0F && turns < window)) return 0.0F;
  const float whole = static_cast<float>(static_cast<std::int32_t>(turns));
  return window * (1.0F - whole / turns);
}

}  // namespace cutforce::estimator
