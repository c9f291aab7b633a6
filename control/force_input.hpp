// The gate before the laws: a force that is missing, stale, not finite or negative never passes.
// The answer is named: fresh, held (the last good force stands in, nothing may rise), or lost
// (nobody knows the force: the override falls, (C11)). FAULTS 1.2 rows 1 and 15, reactions R1, R3.
//
//   A force counts as zero where it is negative by no more than its own uncertainty:
//   F > -min(3 sigma, tolerance), (C5). Noise around zero in the air is no fault.
//   A finite force above `highest_n` counts as `highest_n`: it is at least that.
//   After a loss the estimate must be good for `recover_ticks` in a row before it is trusted.
#pragma once

#include <algorithm>
#include <cstdint>
#include <expected>
#include <type_traits>

namespace cutforce::control {

enum class ForceOutcome : std::uint32_t { kFresh, kHeld, kLost };

// Why a force is not fresh; kRecovering: it is good, but has not been so for long enough.
enum class ForceRefusal : std::uint32_t {
  kNone,
  kMissing,
  kStale,
  kNotFinite,
  kNegative,
  kSigma,
  kRecovering,
};

class ForceInput {
 public:
  enum class ConfigError : std::uint8_t { kStale, kHold, kRecover, kTolerance, kHighest };

  struct Config {
    std::uint32_t stale_ticks;    // an estimate older than this is stale
    std::uint32_t hold_ticks;     // so long the last good force stands in
    std::uint32_t recover_ticks;  // so many good ones in a row end a loss
    float negative_tolerance_n;   // no uncertainty excuses a force below the negative of this
    float highest_n;              // beyond any force of this machine

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (stale_ticks > kTicksLimit) return std::unexpected{ConfigError::kStale};
      if (hold_ticks > kTicksLimit) return std::unexpected{ConfigError::kHold};
      if (recover_ticks < 1 || recover_ticks > kTicksLimit)
        return std::unexpected{ConfigError::kRecover};
      if (!(negative_tolerance_n >= 0.0F && negative_tolerance_n < highest_n))
        return std::unexpected{ConfigError::kTolerance};
      if (!(highest_n > 0.0F && highest_n <= kForceLimitN))
        return std::unexpected{ConfigError::kHighest};
      return {};
    }
  };

  struct Input {
    float force_n;
    float force_sigma_n;
    std::uint32_t age_ticks;  // control ticks since the estimate was made
    bool valid;               // false: there is none
  };

  struct Output {
    float force_n;        // finite, 0..highest_n
    float force_sigma_n;  // finite, >= 0
    ForceOutcome outcome;
    ForceRefusal refusal;
  };

  // Starts as lost: the first estimates are trusted after recover_ticks like those after a loss.
  struct State {
    float force_n = 0.0F;
    float force_sigma_n = 0.0F;
    ForceOutcome outcome = ForceOutcome::kLost;
    std::uint32_t refused_ticks = 0;  // in a row
    std::uint32_t good_ticks = 0;     // in a row, while lost
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<ForceInput, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return ForceInput{config};
  }

  [[nodiscard]] [[gnu::always_inline]] constexpr Output step(const Input& input) noexcept {
    if (is_usual(input)) [[likely]]
      return take(input.force_n, input.force_sigma_n);
    const Input copy = input;  // so that the usual one need not be in memory
    return step_unusual(copy);
  }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr std::uint32_t kTicksLimit = 1'000'000;
  static constexpr float kForceLimitN = 1e6F;
  static constexpr float kLargest = 3e38F;

  explicit constexpr ForceInput(const Config& config) noexcept : config_(config) {}

  // Nothing to refuse and nothing to clamp.
  [[nodiscard]] constexpr bool is_usual(const Input& input) const noexcept {
    const auto in_range = [this](float value) {
      return value >= 0.0F && value <= config_.highest_n;
    };
    return input.valid && input.age_ticks <= config_.stale_ticks && in_range(input.force_n) &&
           in_range(input.force_sigma_n);
  }

  [[nodiscard]] constexpr Output step_unusual(const Input& input) noexcept {
    const ForceRefusal refusal = refuse(input);
    if (refusal != ForceRefusal::kNone) return do_without(refusal);
    return take(std::clamp(input.force_n, 0.0F, config_.highest_n),
                std::min(input.force_sigma_n, config_.highest_n));
  }
  [[gnu::always_inline]] constexpr Output take(float force_n, float force_sigma_n) noexcept {
    state_.refused_ticks = 0;
    if (state_.outcome == ForceOutcome::kLost && ++state_.good_ticks < config_.recover_ticks)
      return answer(ForceRefusal::kRecovering);
    state_.outcome = ForceOutcome::kFresh;
    state_.force_n = force_n;
    state_.force_sigma_n = force_sigma_n;
    return answer(ForceRefusal::kNone);
  }
  constexpr Output do_without(ForceRefusal refusal) noexcept {
    state_.good_ticks = 0;
    state_.refused_ticks = std::min(state_.refused_ticks + 1, kTicksLimit + 1);
    if (state_.outcome != ForceOutcome::kLost) {
      state_.outcome =
          state_.refused_ticks > config_.hold_ticks ? ForceOutcome::kLost : ForceOutcome::kHeld;
    }
    return answer(refusal);
  }
  [[nodiscard]] constexpr Output answer(ForceRefusal refusal) const noexcept {
    return {.force_n = state_.force_n,
            .force_sigma_n = state_.force_sigma_n,
            .outcome = state_.outcome,
            .refusal = refusal};
  }

  // Conditions are written so that NaN is refused.
  [[nodiscard]] constexpr ForceRefusal refuse(const Input& input) const noexcept {
    if (!input.valid) return ForceRefusal::kMissing;
    if (input.age_ticks > config_.stale_ticks) return ForceRefusal::kStale;
    if (!(__builtin_fabsf(input.force_n) <= kLargest)) return ForceRefusal::kNotFinite;
    if (!(input.force_sigma_n >= 0.0F && input.force_sigma_n <= kLargest))
      return ForceRefusal::kSigma;
    const float excused_n = std::min(3.0F * std::min(input.force_sigma_n, config_.highest_n),
                                     config_.negative_tolerance_n);  // (C5)
    if (!(input.force_n >= -excused_n)) return ForceRefusal::kNegative;
    return ForceRefusal::kNone;
  }

  Config config_;
  State state_{};
};

static_assert(std::is_trivially_copyable_v<ForceInput>);
static_assert(sizeof(ForceInput::State) == 5 * 4);

}  // namespace cutforce::control
