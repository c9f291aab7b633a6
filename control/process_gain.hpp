// Static gain of the cutting process, force over override, learned while the tool cuts.
// Equations (C20)-(C23), (C27).
//
//   F(i) = k U_a,   E_f(i) = F(i) - K(i-1) U_a          U_a acted over the interval of F(i)
//   literal      K(i) = K(i-1) + g_c E_f                 P1 (12)
//   normalised   K(i) = K(i-1) + g E_f U_a/(c + U_a^2)   the same pace at every override
//
// F [N], U_a [%], K [N/%], g_c [1/%], c [%^2]. K stays within [least, most]. The model is static:
// the period must be long against the lags between override and force, as P1 assumes, or g small.
// Learned from is only what tells of the process: a tool in the cut, an estimate that is this
// tick's, a force above `excitation_n` and a feed that is not nil; who decides the override does
// not matter, it is known.
#pragma once

#include <algorithm>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "control/law.hpp"

namespace cutforce::control {

// Whether force over override is the gain of a process now.
[[nodiscard]] constexpr bool tells_process_gain(const LawInput& input) noexcept {
  constexpr float kLeastPct = 1.0F;  // a feed below the finest code is nil
  constexpr float kMostPct = 255.0F;
  return input.mode != LawMode::kHold &&
         (input.phase == CutPhase::kCut || input.phase == CutPhase::kEntry) &&
         input.override_applied_pct >= kLeastPct && input.override_applied_pct <= kMostPct;
}

// The estimator; its State is kept by the law that it belongs to.
class ProcessGain {
 public:
  enum class ConfigError : std::uint8_t { kForm, kRate, kRange, kExcitation };
  enum class Form : std::uint8_t { kLiteral, kNormalised };

  struct Config {
    Form form;
    float literal_rate_1_pct;     // g_c, literal form
    float normalised_rate_ratio;  // g, normalised form
    float soft_pct;               // square root of c, normalised form: below it, learn slower
    float initial_n_pct;          // K(0)
    float least_n_pct;
    float most_n_pct;
    float excitation_n;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      switch (form) {
        case Form::kLiteral:  // (C23) at the highest override that there is
          if (!(literal_rate_1_pct > 0.0F && literal_rate_1_pct * 255.0F < 2.0F))
            return std::unexpected{ConfigError::kRate};
          break;
        case Form::kNormalised:
          if (!(normalised_rate_ratio > 0.0F && normalised_rate_ratio < 2.0F))
            return std::unexpected{ConfigError::kRate};
          if (!(soft_pct >= 0.0F && soft_pct <= 1e3F)) return std::unexpected{ConfigError::kRate};
          break;
        default:
          return std::unexpected{ConfigError::kForm};
      }
      if (!(least_n_pct >= 1e-4F && least_n_pct <= initial_n_pct && initial_n_pct <= most_n_pct &&
            most_n_pct <= 1e4F))
        return std::unexpected{ConfigError::kRange};
      if (!(excitation_n >= 0.0F && excitation_n <= 1e6F))
        return std::unexpected{ConfigError::kExcitation};
      return {};
    }
  };

  struct State {
    float gain_n_pct;
    float deviation_ratio;  // short memory of |E_f| / (K U_a), each at most 1
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<ProcessGain, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return ProcessGain{config};
  }

  [[nodiscard]] constexpr State initial() const noexcept {
    return {.gain_n_pct = config_.initial_n_pct, .deviation_ratio = 1.0F};
  }

  // Whether the tick told anything; if not, the state stays.
  constexpr bool learn(State& state, const LawInput& input) const noexcept {
    if (!tells_process_gain(input) || !(input.force_n >= config_.excitation_n)) return false;
    const float expected_n = state.gain_n_pct * input.override_applied_pct;
    const float innovation_n = input.force_n - expected_n;  // (C20)
    const float size_n = innovation_n < 0.0F ? -innovation_n : innovation_n;
    state.deviation_ratio +=
        kMemoryRatio * (std::min(size_n / expected_n, 1.0F) - state.deviation_ratio);
    state.gain_n_pct =
        std::clamp(state.gain_n_pct + rate_1_pct(input.override_applied_pct) * innovation_n,
                   config_.least_n_pct, config_.most_n_pct);
    return true;
  }

  // (C27): the mean size of normal deviations is sqrt(2/pi) of their standard deviation.
  [[nodiscard]] static constexpr float sigma_ratio(const State& state) noexcept {
    return 1.2533141F * state.deviation_ratio;
  }

 private:
  static constexpr float kMemoryRatio = 0.2F;  // about the last five ticks that told something

  explicit constexpr ProcessGain(const Config& config) noexcept : config_(config) {}

  [[nodiscard]] constexpr float rate_1_pct(float applied_pct) const noexcept {
    return config_.form == Form::kLiteral
               ? config_.literal_rate_1_pct  // (C21)
               : config_.normalised_rate_ratio * applied_pct /
                     (config_.soft_pct * config_.soft_pct + applied_pct * applied_pct);  // (C22)
  }

  Config config_;
};

static_assert(std::is_trivially_copyable_v<ProcessGain>);
static_assert(sizeof(ProcessGain::State) == 2 * 4);

}  // namespace cutforce::control
