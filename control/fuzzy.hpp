// Fuzzy law of PI type, (C57)-(C61): P3 4.3, Mamdani, 7 by 7 rules.
//
//   e = F_r - F(i), d = E(i) - E(i-1), both in labels: -3 (NB) ... 0 (ZE) ... 3 (PB), clamped
//   rule (a, b): if e is a and d is b, the step is clamp(a + b, -3, 3)   Mac Vicar-Whelan
//   strength of a rule: the smaller of both memberships; of an output set: its strongest rule
//   step = centroid of the union of the output sets, each cut off at its strength
//   U(i) = U_b(i-1) + step
//
// All sets are triangles of height 1 at the whole labels, reaching to the neighbours; the outermost
// output sets too, so that the whole step is reached. P3 gives the method; ranges and table are the
// project's. U_b as with the PI law (C2).
//
// The centroid is exact, not sampled: between neighbouring labels the union is linear between at
// most five points that the two strengths give, where trapezoids and Simpson's rule are exact.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>

#include "control/law.hpp"

namespace cutforce::control {

class FuzzyPi {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kRange, kStep };

  struct Config {
    float period_s;
    float error_range_n;   // PB and beyond; 250
    float change_range_n;  // of the error in one period; 250
    float step_range_pct;  // of the override in one period; 12

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s > 0.0F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(error_range_n >= 1e-3F && error_range_n <= 1e6F && change_range_n >= 1e-3F &&
            change_range_n <= 1e6F))
        return std::unexpected{ConfigError::kRange};
      if (!(step_range_pct > 0.0F && step_range_pct <= 254.0F))
        return std::unexpected{ConfigError::kStep};
      return {};
    }
  };

  using Input = LawInput;
  using Output = LawOutput;

  struct State {
    float wanted_pct = 100.0F;  // U(i-1)
    float error_n = 0.0F;       // E(i-1)
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<FuzzyPi, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return FuzzyPi{config};
  }

  [[nodiscard]] constexpr Output step(const Input& input) noexcept {
    const float error_n = input.force_reference_n - input.force_n;  // (C1)
    const float change_n = error_n - state_.error_n;
    state_.wanted_pct =
        std::clamp(state_.wanted_pct, input.override_applied_pct - input.override_tolerance_pct,
                   input.override_applied_pct + input.override_tolerance_pct);  // (C2)
    if (input.mode != LawMode::kHold) state_.error_n = error_n;
    if (input.mode != LawMode::kActive) return law_answer(input.override_applied_pct);
    state_.wanted_pct += step_pct(error_n, change_n);  // (C61)
    return law_answer(state_.wanted_pct);
  }

  // The step in override for an error and its change; odd in both together, to the bit.
  [[nodiscard]] constexpr float step_pct(float error_n, float change_n) const noexcept {
    const bool mirrored = error_n < 0.0F || (!(error_n > 0.0F) && change_n < 0.0F);
    const float sign = mirrored ? -1.0F : 1.0F;
    return sign * step_pct_label_ *
           centroid(strengths(sign * error_n * error_label_n_, sign * change_n * change_label_n_));
  }

  // In charge after another law: as make() left it.
  constexpr void rejoin() noexcept { state_ = State{}; }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr int kOuter = 3;  // the outermost label
  static constexpr std::size_t kSets = 2 * kOuter + 1;
  // Of the output sets, with an empty one at either end.
  using Strengths = std::array<float, kSets + 2>;

  explicit constexpr FuzzyPi(const Config& config) noexcept
      : error_label_n_(static_cast<float>(kOuter) / config.error_range_n),
        change_label_n_(static_cast<float>(kOuter) / config.change_range_n),
        step_pct_label_(config.step_range_pct / static_cast<float>(kOuter)) {}

  // A value between two labels belongs to both, in parts that add up to 1; (C57).
  struct Membership {
    int lower;
    std::array<float, 2> part;  // to `lower`, to the one above
  };
  [[nodiscard]] static constexpr Membership membership(float label) noexcept {
    constexpr auto kEnd = static_cast<float>(kOuter);
    const float at = std::clamp(label, -kEnd, kEnd);
    const int lower = std::min(static_cast<int>(at + kEnd), 2 * kOuter - 1) - kOuter;
    const float above = at - static_cast<float>(lower);
    return {.lower = lower, .part = {1.0F - above, above}};
  }

  // (C58), (C59): of the 49 rules four at most have a strength.
  [[nodiscard]] static constexpr Strengths strengths(float error, float change) noexcept {
    const Membership e = membership(error);
    const Membership d = membership(change);
    Strengths strength{};
    for (int i = 0; i < 2; ++i) {
      for (int k = 0; k < 2; ++k) {
        const int set = std::clamp(e.lower + i + d.lower + k, -kOuter, kOuter);
        const auto place = static_cast<unsigned>(set + kOuter + 1);
        float& strongest = strength[place];
        strongest = std::max(strongest, std::min(e.part[static_cast<std::size_t>(i)],
                                                 d.part[static_cast<std::size_t>(k)]));
      }
    }
    return strength;
  }

  // Where the union has a corner between two labels, in order, and the end: where a set leaves its
  // slope, where one slope meets the other's plateau, where slopes meet. Of a strength and what it
  // lacks of 1, one is at most 0.5 and the other at least: four exchanges put them in order.
  [[nodiscard]] static constexpr std::array<float, 6> corners(float falling,
                                                              float rising) noexcept {
    const auto order = [](float& low, float& high) {
      const float less = high < low ? high : low;
      high = high < low ? low : high;
      low = less;
    };
    float a = falling;
    float b = rising;
    float c = 1.0F - rising;
    float d = 1.0F - falling;
    order(a, d), order(b, c), order(a, b), order(c, d);
    return {a, b, 0.5F, c, d, 1.0F};
  }

  // (C60), in labels. One rule at least has half its strength: the area is never 0.
  [[nodiscard]] static constexpr float centroid(const Strengths& strength) noexcept {
    float area = 0.0F;
    float moment = 0.0F;
    for (std::size_t n = 0; n + 1 < strength.size(); ++n) {
      const float falling = strength[n];
      const float rising = strength[n + 1];
      if (!(falling + rising > 0.0F)) continue;
      const auto start = static_cast<float>(n) - static_cast<float>(kOuter + 1);
      const auto height = [&](float t) {
        const float slope = 1.0F - t;
        const float fallen = falling < slope ? falling : slope;
        const float risen = rising < t ? rising : t;
        return fallen < risen ? risen : fallen;
      };
      float left = 0.0F;
      float height_left = falling;  // at a label: that set alone
      float moment_left = start * falling;
      for (const float right : corners(falling, rising)) {
        if (!(right > left)) continue;  // nothing is in between
        const float middle = 0.5F * (left + right);
        const float width = right - left;
        const float height_right = height(right);
        const float moment_right = (start + right) * height_right;
        area += 0.5F * width * (height_left + height_right);
        moment +=
            width / 6.0F * (moment_left + 4.0F * (start + middle) * height(middle) + moment_right);
        left = right;
        height_left = height_right;
        moment_left = moment_right;
      }
    }
    return moment / area;
  }

  float error_label_n_;   // labels per newton
  float change_label_n_;  // labels per newton
  float step_pct_label_;  // percent per label
  State state_{};
};

static_assert(Law<FuzzyPi>);
static_assert(sizeof(FuzzyPi::State) == 2 * 4);

}  // namespace cutforce::control
