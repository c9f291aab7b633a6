// From the override that a law wants to the one that is sent. Equations (C8)-(C10).
//
//   P(i) = P(i-1) + clamp(clamp(U, floor, ceiling) - P(i-1), -slew_down T, slew_up T)
//   sent(i) = sent(i-1) while |P - sent| <= step / 2 + hysteresis, else P rounded to a step
//
// P is the position between two steps, [%], so that a slew rate below one step a tick still gets
// there. Floor and ceiling are moved inward to a step. Each step may narrow them, never widen: a
// new ceiling is reached at the slew rate, the ceiling wins over the floor, and one that is not a
// number lets nothing rise. The output is what is really sent; it is finite and within the limits
// whatever comes in, and does not rise unless it may. A command that is not finite holds.
#pragma once

#include <algorithm>
#include <cstdint>
#include <expected>
#include <type_traits>

namespace cutforce::control {

// Which limit acts, as a set of bits.
enum OverrideLimit : std::uint32_t {
  kNoLimit = 0,
  kFloorLimit = 1U << 0,
  kCeilingLimit = 1U << 1,
  kSlewUpLimit = 1U << 2,
  kSlewDownLimit = 1U << 3,
  kRiseForbidden = 1U << 4,
  kNotFinite = 1U << 5,
};

class FeedOverride {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kStep, kRange, kHysteresis, kSlew, kInitial };

  struct Config {
    float period_s;
    float floor_pct;
    float ceiling_pct;       // at most 254: 255 means "not available" on CAN and stops a FANUC
    std::uint32_t step_pct;  // 1 or 10
    float hysteresis_pct;    // beyond half a step; less than half a step
    float slew_up_pct_s;
    float slew_down_pct_s;
    float initial_pct;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s > 0.0F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (step_pct != 1 && step_pct != 10) return std::unexpected{ConfigError::kStep};
      if (!(floor_pct >= 0.0F && floor_pct < ceiling_pct && ceiling_pct <= 254.0F))
        return std::unexpected{ConfigError::kRange};
      if (!(lowest() < highest())) return std::unexpected{ConfigError::kRange};
      if (!(hysteresis_pct >= 0.0F && hysteresis_pct < 0.5F * static_cast<float>(step_pct)))
        return std::unexpected{ConfigError::kHysteresis};
      if (!(slew_up_pct_s > 0.0F && slew_up_pct_s <= kSlewLimitPctS && slew_down_pct_s > 0.0F &&
            slew_down_pct_s <= kSlewLimitPctS))
        return std::unexpected{ConfigError::kSlew};
      if (!(initial_pct >= floor_pct && initial_pct <= ceiling_pct))
        return std::unexpected{ConfigError::kInitial};
      return {};
    }

    // The outermost steps within floor and ceiling.
    [[nodiscard]] constexpr std::uint32_t lowest() const noexcept {
      const auto below = static_cast<std::uint32_t>(floor_pct) / step_pct * step_pct;
      return static_cast<float>(below) < floor_pct ? below + step_pct : below;
    }
    [[nodiscard]] constexpr std::uint32_t highest() const noexcept {
      return static_cast<std::uint32_t>(ceiling_pct) / step_pct * step_pct;
    }
  };

  struct Input {
    float wanted_pct;
    bool may_rise;
    float ceiling_pct = 254.0F;  // for this step, inside the configured range
    float floor_pct = 0.0F;      // likewise; raises nothing that may not rise
  };

  struct Output {
    std::uint8_t override_pct;  // sent
    std::uint32_t limits;       // set of OverrideLimit
  };

  struct State {
    float position_pct;
    std::uint32_t sent_pct;
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<FeedOverride, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return FeedOverride{config};
  }

  [[nodiscard]] [[gnu::always_inline]] constexpr Output step(const Input& input) noexcept {
    std::uint32_t limits = kNoLimit;
    const float before_pct = state_.position_pct;
    float position_pct = before_pct;
    if (__builtin_fabsf(input.wanted_pct) <= kLargest) {
      const float high_pct = narrowed_high(input.ceiling_pct);
      const float low_pct = narrowed_low(input.floor_pct, high_pct);
      position_pct = clamped(input.wanted_pct, low_pct, high_pct, kFloorLimit, kCeilingLimit,
                             limits);  // (C8)
    } else {
      limits |= kNotFinite;
    }
    position_pct = clamped(position_pct, before_pct - slew_down_pct_, before_pct + slew_up_pct_,
                           kSlewDownLimit, kSlewUpLimit, limits);  // (C9)
    if (position_pct > before_pct && !(input.may_rise && input.ceiling_pct >= 0.0F)) {
      limits |= kRiseForbidden;
      position_pct = before_pct;
    }
    const auto sent_pct = static_cast<float>(state_.sent_pct);
    if (__builtin_fabsf(position_pct - sent_pct) > keep_pct_) {
      state_.sent_pct = rounded(position_pct);  // (C10)
    }
    state_.position_pct = position_pct;
    return {.override_pct = static_cast<std::uint8_t>(state_.sent_pct), .limits = limits};
  }

  // How far a wanted override may be from the sent one by rounding alone.
  [[nodiscard]] constexpr float tolerance_pct() const noexcept { return keep_pct_; }
  [[nodiscard]] constexpr std::uint8_t sent_pct() const noexcept {
    return static_cast<std::uint8_t>(state_.sent_pct);
  }
  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kSlewLimitPctS = 1e6F;
  static constexpr float kLargest = 3e38F;

  explicit constexpr FeedOverride(const Config& config) noexcept
      : step_pct_(config.step_pct),
        lowest_pct_(static_cast<float>(config.lowest())),
        highest_pct_(static_cast<float>(config.highest())),
        keep_pct_(0.5F * static_cast<float>(config.step_pct) + config.hysteresis_pct),
        slew_up_pct_(config.slew_up_pct_s * config.period_s),
        slew_down_pct_(config.slew_down_pct_s * config.period_s) {
    state_.position_pct = std::clamp(config.initial_pct, lowest_pct_, highest_pct_);
    state_.sent_pct = rounded(state_.position_pct);
  }

  // std::clamp, saying which end acted.
  [[nodiscard]] static constexpr float clamped(float value, float low, float high,
                                               OverrideLimit at_low, OverrideLimit at_high,
                                               std::uint32_t& limits) noexcept {
    if (value < low) {
      limits |= at_low;
      return low;
    }
    if (value > high) {
      limits |= at_high;
      return high;
    }
    return value;
  }

  // The outermost steps within what is configured and what this step allows.
  [[nodiscard]] constexpr float narrowed_high(float ceiling_pct) const noexcept {
    if (!(ceiling_pct < highest_pct_)) return highest_pct_;
    if (!(ceiling_pct > lowest_pct_)) return lowest_pct_;
    return static_cast<float>(static_cast<std::uint32_t>(ceiling_pct) / step_pct_ * step_pct_);
  }
  [[nodiscard]] constexpr float narrowed_low(float floor_pct, float high_pct) const noexcept {
    if (!(floor_pct > lowest_pct_)) return lowest_pct_;
    if (!(floor_pct < high_pct)) return high_pct;
    const auto below =
        static_cast<float>(static_cast<std::uint32_t>(floor_pct) / step_pct_ * step_pct_);
    return below < floor_pct ? below + static_cast<float>(step_pct_) : below;
  }

  // To the nearest step; half a step goes down. lowest_pct_ <= position <= highest_pct_.
  [[nodiscard]] constexpr std::uint32_t rounded(float position_pct) const noexcept {
    const auto steps = static_cast<std::uint32_t>(position_pct / static_cast<float>(step_pct_));
    const std::uint32_t below_pct = steps * step_pct_;
    const float beyond_pct = position_pct - static_cast<float>(below_pct);
    return beyond_pct > 0.5F * static_cast<float>(step_pct_) ? below_pct + step_pct_ : below_pct;
  }

  std::uint32_t step_pct_;
  float lowest_pct_;
  float highest_pct_;
  float keep_pct_;
  float slew_up_pct_;
  float slew_down_pct_;
  State state_{};
};

static_assert(std::is_trivially_copyable_v<FeedOverride>);
static_assert(sizeof(FeedOverride::State) == 2 * 4);

}  // namespace cutforce::control
