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

void AirGapPower::begin_window(const Powers& first, float electrical_rad_s) noexcept {
  state_.skip_samples = skipped_samples(electrical_rad_s);
  state_.whole_from = static_cast<std::uint32_t>(state_.skip_samples) + 2;
  if (state_.started != 0) return;
  state_.started = 1;
  state_.last_airgap_w = first.airgap_w;
  state_.last_square_a2 = first.current_square_a2;
}

// In locals over a run, so that all of it stays in registers.
template <AirGapPower::Mode mode>
void AirGapPower::sum(std::span<const MotorSample> samples, float electrical_rad_s) noexcept {
  if (state_.sample == 0) [[unlikely]]
    begin_window(powers<mode>(samples.front(), loss_ohm_, config_.power_factor_ratio),
                 electrical_rad_s);
  const float loss_ohm = loss_ohm_;
  const float power_factor_ratio = config_.power_factor_ratio;
  const std::uint32_t whole_from = state_.whole_from;
  std::uint32_t number = state_.sample;
  Powers last{.airgap_w = state_.last_airgap_w, .current_square_a2 = state_.last_square_a2};
  float weights = state_.weight;
  Powers sums{.airgap_w = state_.airgap_w, .current_square_a2 = state_.current_square_a2};
  float scatters = state_.difference_square_w2;
  for (const MotorSample& sample : samples) {
    const Powers now = powers<mode>(sample, loss_ohm, power_factor_ratio);
    ++number;
    // Trapezoid between two samples, so that the mean belongs to the span between two readings of
    // the speed, (E24).
    const float difference = now.airgap_w - last.airgap_w;
    float power = now.airgap_w + last.airgap_w;
    float current = now.current_square_a2 + last.current_square_a2;
    float scatter = difference * difference;
    float weight = 1.0F;
    if (number < whole_from) [[unlikely]] {
      const float share = static_cast<float>(number) - state_.skip_samples;
      weight = share > 0.0F ? (share < 1.0F ? share : 1.0F) : 0.0F;
      power *= weight;
      current *= weight;
      scatter = weight * difference * difference;
    }
    weights += weight;
    sums.airgap_w += power;
    sums.current_square_a2 += current;
    scatters += scatter;
    last = now;
  }
  state_.sample = number;
  state_.last_airgap_w = last.airgap_w;
  state_.last_square_a2 = last.current_square_a2;
  state_.weight = weights;
  state_.airgap_w = sums.airgap_w;
  state_.current_square_a2 = sums.current_square_a2;
  state_.difference_square_w2 = scatters;
}

bool AirGapPower::add_run(std::span<const MotorSample> samples, float electrical_rad_s) noexcept {
  if (config_.mode == Mode::kDotProduct) [[likely]] {
    sum<Mode::kDotProduct>(samples, electrical_rad_s);
  } else {
    sum<Mode::kFixedPowerFactor>(samples, electrical_rad_s);
  }
  return state_.sample >= config_.samples_per_window;
}

}  // namespace cutforce::estimator
