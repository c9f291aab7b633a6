// PI law whose gains put the closed loop's poles where they are wanted, for the process gain that
// it learns: P1 (11)-(14), here (C20)-(C28).
//
//   plant  F(i) = k U(i-1), the cut that settles within one tick; K estimates k (process_gain.hpp)
//   Kp   = -z1 z2 / K
//   Ki T = (1 - (z1 + z2) + z1 z2) / K
//   U(i) = U_b(i-1) + (Kp + Ki T) E(i) - Kp E(i-1)                           (velocity_form.hpp)
//
// The poles are given by sum and product, real or conjugate. Product 0 is pure integral control,
// which P1 recommends (case III, poles +-0.001, conclusion 5). Both gains are computed from K(i),
// which the force of this very tick has already corrected.
#pragma once

#include <algorithm>
#include <concepts>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "control/law.hpp"
#include "control/process_gain.hpp"
#include "control/velocity_form.hpp"

namespace cutforce::control {

template <std::floating_point Real>
struct AssignedGains {
  Real proportional;   // Kp, override per force
  Real integral_tick;  // Ki T, override per force
};

// P1 (14), (C24), in any units of force over override.
template <std::floating_point Real>
[[nodiscard]] constexpr AssignedGains<Real> assigned_gains(Real process_gain, Real pole_sum,
                                                           Real pole_product) noexcept {
  return {.proportional = -pole_product / process_gain,
          .integral_tick = (Real{1} - pole_sum + pole_product) / process_gain};
}

class PoleAssignment {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kPoles, kEstimate, kSettle };

  struct Config {
    float period_s;
    float pole_sum;
    float pole_product;
    ProcessGain::Config estimate;
    float settle_s;  // in the cut, until the gain counts as settled for wear_ratio()

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s > 0.0F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      // Strictly inside the unit circle, (C25): Jury's conditions of z^2 - sum z + product.
      if (!(1.0F - pole_sum + pole_product > 0.0F && 1.0F + pole_sum + pole_product > 0.0F &&
            pole_product < 1.0F))
        return std::unexpected{ConfigError::kPoles};
      if (!estimate.check()) return std::unexpected{ConfigError::kEstimate};
      if (!(settle_s >= period_s && settle_s <= 1e6F * period_s))
        return std::unexpected{ConfigError::kSettle};
      return {};
    }

    // How many times the estimated gain the true one may be, with the gains as assigned: Jury's
    // conditions of z^2 + (r (Kp + Ki T) K - 1) z - r Kp K, (C26).
    [[nodiscard]] constexpr float stability_margin_ratio() const noexcept {
      const auto gains = assigned_gains(1.0F, pole_sum, pole_product);
      const float alternating = 2.0F * gains.proportional + gains.integral_tick;
      const float size = std::max(gains.proportional, -gains.proportional);
      return 1.0F / std::max({0.5F * alternating, size, 1e-6F});
    }
  };

  using Input = LawInput;
  using Output = LawOutput;

  struct State {
    float wanted_pct = 100.0F;  // U(i-1)
    float error_n = 0.0F;       // E(i-1)
    ProcessGain::State estimate{};
    float settled_n_pct = 0.0F;       // K when it had settled after the last entry; 0 before
    std::uint32_t settled_ticks = 0;  // in the cut, since the last entry
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<PoleAssignment, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return PoleAssignment{config};
  }

  [[nodiscard]] constexpr Output step(const Input& input) noexcept {
    const bool learned = process_gain_.learn(state_.estimate, input);
    settle(input.phase, learned);
    const auto gains =
        assigned_gains(state_.estimate.gain_n_pct, config_.pole_sum, config_.pole_product);
    const float override_pct = velocity_form_pct(state_, input,
                                                 {.proportional_pct_n = gains.proportional,
                                                  .integral_pct_n = gains.integral_tick,
                                                  .tracking_ratio = 1.0F});
    return {.override_pct = override_pct,
            .process_gain_n_pct = state_.estimate.gain_n_pct,
            .process_gain_sigma_ratio = ProcessGain::sigma_ratio(state_.estimate),
            .stability_margin_ratio = config_.stability_margin_ratio()};
  }

  // Wear of the tool as P1 reads it (conclusion 4): the gain over the one that had settled
  // `settle_s` after the last entry, (C28); 1 until then. A deeper or harder cut raises it just
  // the same: it speaks of wear only where the program holds the depth of cut.
  [[nodiscard]] constexpr float wear_ratio() const noexcept {
    return state_.settled_n_pct > 0.0F ? state_.estimate.gain_n_pct / state_.settled_n_pct : 1.0F;
  }

  // In charge after another law: as make() left it.
  constexpr void rejoin() noexcept { state_ = {.estimate = process_gain_.initial()}; }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  // config has passed check(): the estimator can be made.
  explicit constexpr PoleAssignment(const Config& config) noexcept
      : config_(config),
        process_gain_(*ProcessGain::make(config.estimate)),
        settle_ticks_(static_cast<std::uint32_t>(config.settle_s / config.period_s + 0.5F)) {
    rejoin();
  }

  constexpr void settle(CutPhase phase, bool learned) noexcept {
    if (phase == CutPhase::kEntry) {
      state_.settled_n_pct = 0.0F;
      state_.settled_ticks = 0;
    } else if (learned && state_.settled_ticks < settle_ticks_) {
      ++state_.settled_ticks;
      if (state_.settled_ticks == settle_ticks_) state_.settled_n_pct = state_.estimate.gain_n_pct;
    }
  }

  Config config_;
  ProcessGain process_gain_;
  std::uint32_t settle_ticks_;
  State state_{};
};

static_assert(Law<PoleAssignment>);
static_assert(std::is_standard_layout_v<PoleAssignment::State>);
static_assert(sizeof(PoleAssignment::State) == 6 * 4);

}  // namespace cutforce::control
