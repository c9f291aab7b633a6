// Integral law with a constant open-loop gain, P3 (11): (C29)-(C32).
//
//   U(i) = U_b(i-1) + K_open T (F_r - F(i)) / K(i-1),   K = F/U_a, low-passed
//
// F [N], U [%], K [N/%], K_open [1/s]. P3's variable gain is K_open / K. The gain is the one that
// was known before this tick, as printed: a force that jumps up is answered by the gain of the
// lighter cut, so the stronger. K is learned in the cut only and stays in the air (process_gain.hpp
// in its normalised form with c = 0).
#pragma once

#include <cstdint>
#include <expected>
#include <type_traits>

#include "control/law.hpp"
#include "control/process_gain.hpp"
#include "control/velocity_form.hpp"

namespace cutforce::control {

class VariableGain {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kLatency, kOpenLoop, kSmoothing, kEstimate };

  struct Config {
    float period_s;
    float open_loop_1_s;  // K_open; 3 to 4 advised
    // Whole periods between an override and the first force that shows it, beyond the one that
    // the zero-order hold has anyhow.
    std::uint32_t latency_ticks;
    float smoothing_s;    // time constant of the low-pass of F/U; 0: none
    float initial_n_pct;  // K(0)
    float least_n_pct;
    float most_n_pct;
    float excitation_n;  // a lighter force teaches nothing; 60

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s > 0.0F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (latency_ticks > 1000) return std::unexpected{ConfigError::kLatency};
      if (!(open_loop_1_s >= 1e-3F && stability_margin_ratio() > 1.0F))
        return std::unexpected{ConfigError::kOpenLoop};
      if (!(smoothing_s >= 0.0F && smoothing_s <= 1e4F * period_s))
        return std::unexpected{ConfigError::kSmoothing};
      if (!estimate().check()) return std::unexpected{ConfigError::kEstimate};
      return {};
    }

    // How many times the estimated gain the true one may be, whatever the process's own time
    // constant: K_open T < 2 without latency, K_open T < 1/n with n ticks of it, (C31), (C32).
    [[nodiscard]] constexpr float stability_margin_ratio() const noexcept {
      const float highest = latency_ticks == 0 ? 2.0F : 1.0F / static_cast<float>(latency_ticks);
      return highest / (open_loop_1_s * period_s);
    }

    [[nodiscard]] constexpr ProcessGain::Config estimate() const noexcept {
      return {.form = ProcessGain::Form::kNormalised,
              .literal_rate_1_pct = 0.0F,
              .normalised_rate_ratio = period_s / (period_s + smoothing_s),  // (C30)
              .soft_pct = 0.0F,
              .initial_n_pct = initial_n_pct,
              .least_n_pct = least_n_pct,
              .most_n_pct = most_n_pct,
              .excitation_n = excitation_n};
    }
  };

  using Input = LawInput;
  using Output = LawOutput;

  struct State {
    float wanted_pct = 100.0F;  // U(i-1)
    float error_n = 0.0F;       // E(i-1)
    ProcessGain::State estimate{};
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<VariableGain, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return VariableGain{config};
  }

  [[nodiscard]] constexpr Output step(const Input& input) noexcept {
    const float override_pct =
        velocity_form_pct(state_, input,
                          {.proportional_pct_n = 0.0F,
                           .integral_pct_n = open_loop_ratio_ / state_.estimate.gain_n_pct,
                           .tracking_ratio = 1.0F});  // (C29)
    process_gain_.learn(state_.estimate, input);
    return {.override_pct = override_pct,
            .process_gain_n_pct = state_.estimate.gain_n_pct,
            .process_gain_sigma_ratio = ProcessGain::sigma_ratio(state_.estimate),
            .stability_margin_ratio = stability_margin_ratio_};
  }

  // In charge after another law: as make() left it.
  constexpr void rejoin() noexcept { state_ = {.estimate = process_gain_.initial()}; }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  // config has passed check(): the estimator can be made.
  explicit constexpr VariableGain(const Config& config) noexcept
      : process_gain_(*ProcessGain::make(config.estimate())),
        open_loop_ratio_(config.open_loop_1_s * config.period_s),
        stability_margin_ratio_(config.stability_margin_ratio()) {
    rejoin();
  }

  ProcessGain process_gain_;
  float open_loop_ratio_;
  float stability_margin_ratio_;
  State state_{};
};

static_assert(Law<VariableGain>);
static_assert(std::is_standard_layout_v<VariableGain::State>);
static_assert(sizeof(VariableGain::State) == 4 * 4);

}  // namespace cutforce::control
