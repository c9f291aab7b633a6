#include "estimator/air_gap_power.hpp"

#include <algorithm>
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

auto AirGapPower::close_window() noexcept -> Output {
  const float mean = state_.airgap_w / state_.weight;
  const float square = state_.current_square_a2 / state_.weight;
  const Output output{
      .airgap_power_w = mean,
      .input_power_w = mean + loss_ohm_ * square,
      .current_square_a2 = square,
      // (E25): scatter from first differences, which a load step within the window hardly moves.
      .noise_variance_w2 = 0.5F * state_.difference_square_w2 / (state_.weight * state_.weight)};
  state_.sample = 0;
  state_.weight = 0.0F;
  state_.airgap_w = 0.0F;
  state_.current_square_a2 = 0.0F;
  state_.difference_square_w2 = 0.0F;
  return output;
}

}  // namespace cutforce::estimator
