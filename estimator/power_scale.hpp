// Scale of the computed power against the drive's own power meter.
//
//   P_lag += (P_i - P_lag) h / tau_m              the meter as it should read             (E120)
//   g = meter / P_lag,  averaged where it is well defined                                 (E121)
//   T' = T + (g - 1) (P_i - P_i,tare) p / w_e                                             (E122)
// A common gain of all voltage and current sensors shows nowhere else. The meter is slow, and only
// its ratio in slow states is used: g is one Kalman state with the sensors' gain uncertainty as
// its prior and the meter's own as the floor of what can be learned. A meter that is far off is
// not a check but a fault of wiring or scale: it is left alone.
// Source: ESTIMATOR prototype 1.6.
#pragma once

#include <cstdint>
#include <expected>
#include <type_traits>

namespace cutforce::estimator {

class PowerScale {
 public:
  enum class ConfigError : std::uint8_t { kLag, kPower, kUncertainty };

  struct Config {
    float lag_s;
    float rated_power_w;
    float gain_sigma_ratio;   // of voltage times current, 1 sigma
    float meter_sigma_ratio;  // of the meter's scale, 1 sigma
    float implausible_ratio;  // beyond this deviation the meter is not believed

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(lag_s > 0.0F)) return std::unexpected{ConfigError::kLag};
      if (!(rated_power_w > 0.0F)) return std::unexpected{ConfigError::kPower};
      if (!(gain_sigma_ratio >= 0.0F && meter_sigma_ratio > 0.0F && implausible_ratio > 0.0F))
        return std::unexpected{ConfigError::kUncertainty};
      return {};
    }
  };

  struct State {
    float lagged_w = 0.0F;
    float gain = 1.0F;
    float variance = 0.0F;
    std::uint32_t started = 0;
  };

  [[nodiscard]] static constexpr std::expected<PowerScale, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return PowerScale{config};
  }

  // power_w: mean input power of the tick; meter_w: the reading at its end.
  constexpr void step(float power_w, float meter_w, float duration_s) noexcept {
    if (state_.started == 0) {
      state_.lagged_w = meter_w;
      state_.variance = config_.gain_sigma_ratio * config_.gain_sigma_ratio;
      state_.started = 1;
    }
    const float share = duration_s < config_.lag_s ? duration_s / config_.lag_s : 1.0F;
    state_.lagged_w += share * (power_w - state_.lagged_w);
    if (!(state_.lagged_w > kSmallestPower_ratio * config_.rated_power_w)) return;
    const float off = meter_w / state_.lagged_w - 1.0F;
    if (!(off < config_.implausible_ratio && off > -config_.implausible_ratio)) return;
    // While the power still moves, an error of the lag shows as an error of the scale.
    const float moving = (power_w - state_.lagged_w) / state_.lagged_w;
    const float from_lag = kLagError_ratio * moving;
    const float noise =
        (config_.meter_sigma_ratio * config_.meter_sigma_ratio + from_lag * from_lag) *
        kCorrelation_s / duration_s;
    const float gain = state_.variance / (state_.variance + noise);
    state_.gain += gain * (1.0F + off - state_.gain);
    state_.variance *= 1.0F - gain;
    const float floor = config_.meter_sigma_ratio * config_.meter_sigma_ratio;
    const float least = floor < config_.gain_sigma_ratio * config_.gain_sigma_ratio
                            ? floor
                            : config_.gain_sigma_ratio * config_.gain_sigma_ratio;
    if (state_.variance < least) state_.variance = least;
  }

  // Without what the meter's own uncertainty explains: a check, not a second source.
  [[nodiscard]] constexpr float gain_ratio() const noexcept {
    const float off = state_.gain - 1.0F;
    const float excused = kExcused_sigmas * config_.meter_sigma_ratio;
    if (off > excused) return 1.0F + (off - excused);
    return off < -excused ? 1.0F + (off + excused) : 1.0F;
  }
  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kExcused_sigmas = 0.4F;
  static constexpr float kSmallestPower_ratio = 0.2F;
  static constexpr float kLagError_ratio = 0.1F;
  static constexpr float kCorrelation_s = 0.1F;  // readings within it are one

  explicit constexpr PowerScale(const Config& config) noexcept : config_(config) {}

  Config config_;
  State state_{};
};

static_assert(std::is_trivially_copyable_v<PowerScale>);

}  // namespace cutforce::estimator
