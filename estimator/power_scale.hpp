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
    if (state_.started == 0) [[unlikely]] {
      state_.lagged_w = meter_w;
      state_.started = 1;
    }
    const float share = duration_s < config_.lag_s ? duration_s * per_lag_1_s_ : 1.0F;
    state_.lagged_w += share * (power_w - state_.lagged_w);
    compare(power_w, meter_w, duration_s);
  }

  // Without what the meter's own uncertainty explains: a check, not a second source.
  [[nodiscard]] constexpr float gain_ratio() const noexcept { return 1.0F + excess_ratio_; }
  [[nodiscard]] constexpr float excess_ratio() const noexcept { return excess_ratio_; }  // g - 1
  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept {
    state_ = state;
    find_excess();
  }

 private:
  static constexpr float kExcused_sigmas = 0.4F;
  static constexpr float kSmallestPower_ratio = 0.2F;
  static constexpr float kLagError_ratio = 0.1F;
  static constexpr float kCorrelation_s = 0.1F;  // readings within it are one

  explicit constexpr PowerScale(const Config& config) noexcept
      : per_lag_1_s_(1.0F / config.lag_s), config_(config) {
    state_.variance = config.gain_sigma_ratio * config.gain_sigma_ratio;
  }

  [[gnu::noinline]] constexpr void compare(float power_w, float meter_w,
                                           float duration_s) noexcept {
    if (!(state_.lagged_w > kSmallestPower_ratio * config_.rated_power_w)) return;
    const float off = meter_w / state_.lagged_w - 1.0F;
    if (!(off < config_.implausible_ratio && off > -config_.implausible_ratio)) return;
    // While the power still moves, an error of the lag shows as an error of the scale.
    const float from_lag = kLagError_ratio * (power_w - state_.lagged_w) / state_.lagged_w;
    const float least = config_.meter_sigma_ratio * config_.meter_sigma_ratio;
    const float noise = (least + from_lag * from_lag) * kCorrelation_s / duration_s;
    const float gain = state_.variance / (state_.variance + noise);
    state_.gain += gain * (1.0F + off - state_.gain);
    state_.variance *= 1.0F - gain;
    const float prior = config_.gain_sigma_ratio * config_.gain_sigma_ratio;
    const float floor = least < prior ? least : prior;
    if (state_.variance < floor) state_.variance = floor;
    find_excess();
  }
  constexpr void find_excess() noexcept {
    const float off = state_.gain - 1.0F;
    const float excused = kExcused_sigmas * config_.meter_sigma_ratio;
    excess_ratio_ = off > excused ? off - excused : (off < -excused ? off + excused : 0.0F);
  }

  float excess_ratio_ = 0.0F;
  float per_lag_1_s_;
  State state_{};
  Config config_;
};

static_assert(std::is_trivially_copyable_v<PowerScale>);

}  // namespace cutforce::estimator
