// P3's synthesized monitor: the slow measured estimate while the power is steady, the computed
// one while it moves.
//   switch to computed when |P_g - P_o| / P_o > threshold          (E40), P3 (9), absolute
//                    or when (P_g - P_o) / P_o > threshold          positive-only, P3's text
//   stay there for the hold time after the last excess; T = compensation * T_computed meanwhile
// The formula and "start and end of cutting" speak for the absolute form, the sentence about a
// "positive difference" for the other: with it the end of a cut is seen through the slow meter.
// P_o in the denominator is kept above a floor, and its amount is taken: a drive that regenerates
// has P_o < 0. The compensation stands for the slip that P_g/w_M leaves out.
#pragma once

#include <cstdint>
#include <expected>
#include <type_traits>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {

class SynthesizedMonitor {
 public:
  enum class Mode : std::uint8_t { kAbsolute, kPositiveOnly };
  enum class ConfigError : std::uint8_t { kPeriod, kThreshold, kHold, kCompensation, kFloor };

  struct Config {
    float period_s;
    Mode mode;
    float threshold_ratio;
    float hold_s;  // rounded to whole periods
    float compensation_ratio;
    float power_floor_w;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s >= 1e-4F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(threshold_ratio > 0.0F && threshold_ratio < 100.0F)) {
        return std::unexpected{ConfigError::kThreshold};
      }
      if (!(hold_s >= 0.0F && hold_s <= 1000.0F)) return std::unexpected{ConfigError::kHold};
      if (!(compensation_ratio > 0.0F && compensation_ratio < 10.0F)) {
        return std::unexpected{ConfigError::kCompensation};
      }
      if (!(power_floor_w > 0.0F && power_floor_w < 1e9F)) {
        return std::unexpected{ConfigError::kFloor};
      }
      return {};
    }
  };

  struct Input {
    float computed_power_w;  // P_g
    float measured_power_w;  // P_o
    float computed_torque_nm;
    float measured_torque_nm;
  };

  struct Output {
    float torque_nm;
    float factor_ratio;  // of the chosen torque: the compensation, or 1
    float power_ratio;   // what was compared with the threshold, with its sign
    bool computed;       // which estimate fed the output
  };

  struct Choice {
    float factor_ratio;
    float power_ratio;
    bool computed;
  };

  struct State {
    std::uint32_t hold_windows = 0;  // still to come on the computed estimate
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<SynthesizedMonitor, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return SynthesizedMonitor{config};
  }

  [[nodiscard]] constexpr Output step(const Input& input) noexcept {
    const Choice choice = choose(input.computed_power_w, input.measured_power_w);
    const float torque_nm = choice.computed ? input.computed_torque_nm : input.measured_torque_nm;
    return {.torque_nm = choice.factor_ratio * torque_nm,
            .factor_ratio = choice.factor_ratio,
            .power_ratio = choice.power_ratio,
            .computed = choice.computed};
  }
  // The same for one who makes the torques afterwards: the powers alone decide.
  [[nodiscard]] constexpr Choice choose(float computed_power_w, float measured_power_w) noexcept {
    const float amount = magnitude(measured_power_w);
    const float below = amount > config_.power_floor_w ? amount : config_.power_floor_w;
    const float ratio = (computed_power_w - measured_power_w) / below;  // (E40)
    const bool excess = ratio > config_.threshold_ratio ||
                        (config_.mode == Mode::kAbsolute && ratio < -config_.threshold_ratio);

    const bool computed = excess || state_.hold_windows > 0;
    if (excess) {
      state_.hold_windows = hold_windows_;
    } else if (state_.hold_windows > 0) {
      --state_.hold_windows;
    }
    return {.factor_ratio = computed ? config_.compensation_ratio : 1.0F,
            .power_ratio = ratio,
            .computed = computed};
  }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  explicit constexpr SynthesizedMonitor(const Config& config) noexcept
      : config_(config),
        hold_windows_(static_cast<std::uint32_t>(config.hold_s / config.period_s + 0.5F)) {}

  Config config_;
  std::uint32_t hold_windows_;
  State state_{};
};

static_assert(std::is_trivially_copyable_v<SynthesizedMonitor>);

}  // namespace cutforce::estimator
