// Where the tool is: in the air, entering, in the cut, or perhaps out of it. Equations (C6), (C7).
//
//   air   -- F > on --> entry                 entry -- entry time --> cut
//   entry, cut -- F < off --> exit            exit  -- F > on --> cut
//   exit  -- lost time, F < off --> air       exit  -- lost time, F >= off --> cut
//
// on > off, both as parts of the force reference: noise does not toggle. A force that vanishes in
// the cut is a broken tool until proved otherwise: for `lost_s` after it the cut is not believed to
// be over, and nothing may speed up (FAULTS 1.2 row 17). A tick whose force has fallen steeply is
// the first sign of it (`falling`), before the force is below `off`; measured against the force
// itself, so that a lagging estimate is seen to fall to the end of its decay. A gap of an
// interrupted cut looks the same and returns from exit to cut without a new entry.
#pragma once

#include <algorithm>
#include <cstdint>
#include <expected>
#include <type_traits>

namespace cutforce::control {

enum class CutPhase : std::uint32_t { kAir, kEntry, kCut, kExit };

class CutState {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kThresholds, kEntry, kLost, kDrop };

  struct Config {
    float period_s;
    float on_ratio;    // of the reference; 0.13
    float off_ratio;   // of the reference; 0.10
    float entry_s;     // a cut counts as entered after this; 0.15
    float lost_s;      // a cut counts as lost after this; 0.5
    float drop_ratio;  // of the force before: a fall by more within one tick is steep; 0.1
                       // (1: never, for a paper's law as printed)

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s > 0.0F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(off_ratio > 0.0F && off_ratio < on_ratio && on_ratio < 1.0F))
        return std::unexpected{ConfigError::kThresholds};
      if (!(entry_s >= 0.0F && entry_s <= kLongestTicks * period_s))
        return std::unexpected{ConfigError::kEntry};
      if (!(lost_s >= period_s && lost_s <= kLongestTicks * period_s))
        return std::unexpected{ConfigError::kLost};
      if (!(drop_ratio > 0.0F && drop_ratio <= 1.0F)) return std::unexpected{ConfigError::kDrop};
      return {};
    }
  };

  struct Input {
    float force_n;            // finite, >= 0
    float force_reference_n;  // > 0
    bool fresh;               // false: the force is not new, nothing changes
  };

  struct Output {
    CutPhase phase;
    bool falling;  // in the cut, and the force has just fallen steeply
  };

  struct State {
    CutPhase phase = CutPhase::kAir;
    std::uint32_t ticks = 0;  // in kEntry and kExit, since it began
    float force_n = 0.0F;     // the last fresh one
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<CutState, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return CutState{config};
  }

  [[nodiscard]] [[gnu::always_inline]] constexpr Output step(const Input& input) noexcept {
    if (!input.fresh) return {.phase = state_.phase, .falling = false};
    const bool on = input.force_n > config_.on_ratio * input.force_reference_n;    // (C6)
    const bool off = input.force_n < config_.off_ratio * input.force_reference_n;  // (C6)
    const bool steep =
        state_.force_n - input.force_n > config_.drop_ratio * state_.force_n;  // (C7)
    state_.force_n = input.force_n;
    state_.ticks = state_.ticks < most_ticks_ ? state_.ticks + 1 : most_ticks_;
    advance(on, off);
    return {.phase = state_.phase, .falling = steep && state_.phase != CutPhase::kAir};
  }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kLongestTicks = 1e6F;

  explicit constexpr CutState(const Config& config) noexcept
      : config_(config),
        entry_ticks_(whole_ticks(config.entry_s, config.period_s)),
        lost_ticks_(whole_ticks(config.lost_s, config.period_s)),
        most_ticks_(lost_ticks_ + entry_ticks_ + 1) {}

  // The fewest whole periods that last at least `time_s`, but for a thousandth of a period: 0.5 s
  // of 0.05 s are 10 ticks although their quotient in single precision may be above 10.
  [[nodiscard]] static constexpr std::uint32_t whole_ticks(float time_s, float period_s) noexcept {
    const float ticks = time_s / period_s;
    const auto below = static_cast<std::uint32_t>(ticks);
    return ticks - static_cast<float>(below) > 1e-3F ? below + 1 : below;
  }

  constexpr void enter(CutPhase phase) noexcept {
    state_.phase = phase;
    state_.ticks = 0;
  }

  constexpr void advance(bool on, bool off) noexcept {
    switch (state_.phase) {
      case CutPhase::kAir:
        if (on) enter(CutPhase::kEntry);
        break;
      case CutPhase::kEntry:
        if (off) {
          enter(CutPhase::kExit);
        } else if (state_.ticks >= entry_ticks_) {
          enter(CutPhase::kCut);
        }
        break;
      case CutPhase::kCut:
        if (off) enter(CutPhase::kExit);
        break;
      case CutPhase::kExit:
        if (on) {
          enter(CutPhase::kCut);
        } else if (state_.ticks >= lost_ticks_) {
          enter(off ? CutPhase::kAir : CutPhase::kCut);  // in between: a light cut that goes on
        }
        break;
    }
  }

  Config config_;
  std::uint32_t entry_ticks_;
  std::uint32_t lost_ticks_;
  std::uint32_t most_ticks_;  // that tell anything
  State state_{};
};

static_assert(std::is_trivially_copyable_v<CutState>);
static_assert(sizeof(CutState::State) == 3 * 4);

}  // namespace cutforce::control
