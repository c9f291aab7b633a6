#include "estimator/air_gap_power.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace cutforce::estimator {

auto AirGapPower::step(const Input& input) noexcept -> std::optional<Output> {
  const MotorSample& sample = input.sample;
  const float square = dot(sample.current_a, sample.current_a);
  const float copper = loss_ohm_ * square;  // (E22)
  const float in = config_.mode == Mode::kDotProduct
                       ? input_power(sample)  // (E21)
                       : 1.5F * config_.power_factor_ratio *
                             std::sqrt(square * dot(sample.voltage_v, sample.voltage_v));  // (E23)
  const float airgap = in - copper;

  if (state_.started == 0) {
    state_.started = 1;
    state_.last_airgap_w = airgap;
    state_.last_square_a2 = square;
  }
  if (state_.sample == 0) state_.skip_samples = skipped_samples(input.electrical_rad_s);
  ++state_.sample;

  // Trapezoid between two samples, so that the mean belongs to the span between two readings of
  // the speed, (E24).
  const float weight =
      std::clamp(static_cast<float>(state_.sample) - state_.skip_samples, 0.0F, 1.0F);
  const float difference = airgap - state_.last_airgap_w;
  state_.weight += weight;
  state_.airgap_w += weight * 0.5F * (airgap + state_.last_airgap_w);
  state_.current_square_a2 += weight * 0.5F * (square + state_.last_square_a2);
  state_.difference_square_w2 += weight * difference * difference;
  state_.last_airgap_w = airgap;
  state_.last_square_a2 = square;

  if (state_.sample < config_.samples_per_window) return std::nullopt;
  return close_window();
}

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
