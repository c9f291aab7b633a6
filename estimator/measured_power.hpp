// The drive's own slow power output as power across the air gap.
//   P_1 = scale (meter - offset)                                                  (E36)
//   P_o = efficiency P_1 - loss(w) - c_2 P_1^2 - idle bias                        (E37)
// loss(w) is a table over speed, so that a polynomial c_0 + c_1 w, magnetising copper and iron
// loss all fit. The idle bias is the mean of P_o - P_g over the idle just before contact, where
// computed power exists: P3's method compares the two powers and can do so only if they agree
// when nothing is cut. It is learned only while the meter has settled. The meter's lag is a
// first-order model constant; it is not inverted here but published for others, and turned into
// uncertainty:
//   sigma^2 = noise^2 + (share P_o)^2 + (lag dP_o/dt)^2                           (E38)
// The last term is exact for a first-order lag: that much is the reading behind the power. What
// the noise alone adds to it on average is taken off.
#pragma once

#include <cmath>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "estimator/speed_table.hpp"

namespace cutforce::estimator {

class MeasuredPower {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kScale, kLoss, kLag, kNoise, kMemory };

  struct Config {
    float period_s;  // of the windows
    float scale_ratio;
    float offset_w;
    float efficiency_ratio;    // 1 where a loss map is given instead
    SpeedTable loss_w;         // over motor speed
    float loss_quadratic_1_w;  // c_2
    float lag_s;               // first order, 0: none
    float noise_w;             // standard deviation of one window's mean
    float model_sigma_ratio;   // of the conversion, share of P_o
    float bias_memory_s;       // time constant of the idle bias
    float settled_w;           // the bias is learned while P_o is this near to its own slow mean

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s >= 1e-4F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(scale_ratio > 0.0F && scale_ratio < 1e6F && offset_w > -1e7F && offset_w < 1e7F)) {
        return std::unexpected{ConfigError::kScale};
      }
      if (!(efficiency_ratio > 0.0F && efficiency_ratio <= 2.0F && loss_w.rising() &&
            loss_quadratic_1_w >= 0.0F && loss_quadratic_1_w < 1.0F)) {
        return std::unexpected{ConfigError::kLoss};
      }
      for (const float loss : loss_w.value) {
        if (!(loss > -1e7F && loss < 1e7F)) return std::unexpected{ConfigError::kLoss};
      }
      if (!(lag_s >= 0.0F && lag_s <= 100.0F)) return std::unexpected{ConfigError::kLag};
      if (!(noise_w >= 0.0F && model_sigma_ratio >= 0.0F && noise_w < 1e7F &&
            model_sigma_ratio < 10.0F)) {
        return std::unexpected{ConfigError::kNoise};
      }
      if (!(bias_memory_s > 0.0F && bias_memory_s <= 1e4F && settled_w > 0.0F)) {
        return std::unexpected{ConfigError::kMemory};
      }
      return {};
    }
  };

  struct Input {
    float meter_w;      // mean reading over the window
    float speed_rad_s;  // motor shaft
  };

  struct Output {
    float power_w;
    float sigma_w;
  };

  struct State {
    float bias_w = 0.0F;
    float unbiased_w = 0.0F;    // P_o before the bias, of the window before
    float slow_w = 0.0F;        // its mean over about one lag
    std::uint32_t windows = 0;  // seen, 0 or 1
    std::uint32_t idle = 0;     // windows in the bias, at most the memory
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<MeasuredPower, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return MeasuredPower{config};
  }

  // One window.
  [[nodiscard]] Output step(const Input& input) noexcept {
    const float corrected = config_.scale_ratio * (input.meter_w - config_.offset_w);  // (E36)
    const float power = config_.efficiency_ratio * corrected - loss_w_.at(input.speed_rad_s) -
                        config_.loss_quadratic_1_w * corrected * corrected;  // (E37)
    const float before = state_.windows == 0 ? power : state_.unbiased_w;
    const float slow = state_.windows == 0 ? power : state_.slow_w;
    state_.slow_w = slow + slow_share_ * (power - slow);
    state_.unbiased_w = power;
    state_.windows = 1;
    return {.power_w = power - state_.bias_w, .sigma_w = sigma(power, power - before)};
  }

  // After a step in idle: the same window's air-gap power, which P_o should have shown, W.
  constexpr void calibrate(float airgap_power_w) noexcept {
    const float unsettled = state_.unbiased_w - state_.slow_w;
    if (!(unsettled <= config_.settled_w && unsettled >= -config_.settled_w)) return;
    const float longest = config_.bias_memory_s / config_.period_s;
    if (static_cast<float>(state_.idle) < longest) ++state_.idle;
    const float count = static_cast<float>(state_.idle);
    state_.bias_w += (state_.unbiased_w - airgap_power_w - state_.bias_w) / count;
  }

  [[nodiscard]] constexpr float lag_s() const noexcept { return config_.lag_s; }
  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  explicit constexpr MeasuredPower(const Config& config) noexcept
      : config_(config),
        loss_w_(config.loss_w),
        slow_share_(config.period_s / (config.period_s + config.lag_s)),
        noise_w2_(config.noise_w * config.noise_w),
        behind_(config.lag_s / config.period_s * (config.lag_s / config.period_s)) {}

  // (E38)
  [[nodiscard]] float sigma(float power_w, float change_w) const noexcept {
    const float behind = behind_ * (change_w * change_w - 2.0F * noise_w2_);
    const float model = config_.model_sigma_ratio * power_w;
    return std::sqrt(noise_w2_ + model * model + (behind > 0.0F ? behind : 0.0F));
  }

  Config config_;
  SpeedLines loss_w_;
  float slow_share_;  // of the slow mean, a window
  float noise_w2_;
  float behind_;  // lag over period, squared
  State state_{};
};

static_assert(std::is_trivially_copyable_v<MeasuredPower>);

}  // namespace cutforce::estimator
