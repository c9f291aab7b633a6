#include "estimator/synchronous_speed.hpp"

namespace cutforce::estimator {
auto SynchronousSpeed::close_window() noexcept -> Output {
  const float count = static_cast<float>(config_.samples_per_window);
  const float end_count = static_cast<float>(end_samples_);
  const float electrical = state_.angle_rad / (count * config_.sample_period_s);  // (E26)
  const float amount = magnitude(electrical);
  const bool valid =
      amount >= config_.minimum_electrical_rad_s &&
      state_.current_square_a2 >= count * config_.minimum_current_a * config_.minimum_current_a;
  const float leak = valid ? config_.flux_leak_rad_s / electrical : 0.0F;
  const Output output{
      .electrical_rad_s = electrical,
      .synchronous_rad_s = electrical / config_.pole_pairs,  // (E27)
      .synchronous_end_rad_s =
          state_.angle_end_rad / (end_count * config_.sample_period_s * config_.pole_pairs),
      .flux_square_v2s2 = state_.flux_square_v2s2 / count * (1.0F + leak * leak),
      .valid = valid};
  state_.angle_rad = 0.0F;
  state_.angle_end_rad = 0.0F;
  state_.flux_square_v2s2 = 0.0F;
  state_.current_square_a2 = 0.0F;
  state_.sample = 0;
  return output;
}

}  // namespace cutforce::estimator
