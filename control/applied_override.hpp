// Which override acted on the force that is being looked at: the one that was sent, unless the CNC
// reports another and so does not follow (locked, or its own knob turned). FAULTS 1.2 row 19.
//
//   The CNC follows iff its report lies within what was sent over the last `delay_ticks` + 1 ticks,
//   give or take `tolerance_pct`, (C14). The report of a CNC that follows is late by its own
//   delay, so what was sent is the better number then. After `confirm_ticks` reports in a row that
//   do not follow, the report is the override that acts, and a law cannot wind up against it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <type_traits>

namespace cutforce::control {

class AppliedOverride {
 public:
  static constexpr std::uint32_t kHistory = 16;

  enum class ConfigError : std::uint8_t { kDelay, kConfirm, kTolerance, kInitial };

  struct Config {
    std::uint32_t delay_ticks;    // longest delay of the CNC's report, below kHistory
    std::uint32_t confirm_ticks;  // at least 1
    float tolerance_pct;
    std::uint8_t initial_pct;  // sent before the first step

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (delay_ticks >= kHistory) return std::unexpected{ConfigError::kDelay};
      if (confirm_ticks < 1 || confirm_ticks > 1'000'000)
        return std::unexpected{ConfigError::kConfirm};
      if (!(tolerance_pct >= 0.0F && tolerance_pct <= 100.0F))
        return std::unexpected{ConfigError::kTolerance};
      if (initial_pct > 254) return std::unexpected{ConfigError::kInitial};
      return {};
    }
  };

  struct Input {
    std::uint8_t sent_pct;  // with the last tick's command
    float reported_pct;
    bool reported;  // false: the CNC tells nothing
  };

  struct Output {
    float applied_pct;
    bool follows;
  };

  struct State {
    std::array<std::uint8_t, kHistory> sent_pct{};  // a ring, newest first from `newest` on
    std::uint32_t newest = 0;
    std::uint32_t differing_ticks = 0;
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<AppliedOverride, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return AppliedOverride{config};
  }

  // A report that is not within 0..255 % tells nothing.
  [[nodiscard]] [[gnu::always_inline]] constexpr Output step(const Input& input) noexcept {
    state_.newest = (state_.newest + kHistory - 1) % kHistory;
    state_.sent_pct[state_.newest] = input.sent_pct;

    // At rest, the report is what was sent last: then the ring need not be read.
    const auto sent_pct = static_cast<float>(input.sent_pct);
    if (!input.reported || within(sent_pct, sent_pct, input.reported_pct) ||
        !(input.reported_pct >= 0.0F && input.reported_pct <= 255.0F) ||
        follows(input.reported_pct)) {
      state_.differing_ticks = 0;
    } else {
      state_.differing_ticks = std::min(state_.differing_ticks + 1, config_.confirm_ticks);
    }
    const bool locked = state_.differing_ticks >= config_.confirm_ticks;
    return {.applied_pct = locked ? input.reported_pct : sent_pct, .follows = !locked};
  }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  explicit constexpr AppliedOverride(const Config& config) noexcept : config_(config) {
    state_.sent_pct.fill(config.initial_pct);
  }

  [[nodiscard]] constexpr bool follows(float reported_pct) const noexcept {  // (C14)
    std::uint32_t lowest = 255;
    std::uint32_t highest = 0;
    for (std::uint32_t i = 0; i <= config_.delay_ticks; ++i) {
      const std::uint32_t sent = state_.sent_pct[(state_.newest + i) % kHistory];
      lowest = sent < lowest ? sent : lowest;
      highest = sent > highest ? sent : highest;
    }
    return within(static_cast<float>(lowest), static_cast<float>(highest), reported_pct);
  }
  [[nodiscard]] constexpr bool within(float lowest_pct, float highest_pct,
                                      float reported_pct) const noexcept {
    return reported_pct >= lowest_pct - config_.tolerance_pct &&
           reported_pct <= highest_pct + config_.tolerance_pct;
  }

  Config config_;
  State state_{};
};

static_assert(std::is_trivially_copyable_v<AppliedOverride>);
static_assert(sizeof(AppliedOverride::State) == 16 + 2 * 4);

}  // namespace cutforce::control
