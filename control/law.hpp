// The one shape of every controller: what a law is told once a control tick, and what it answers.
//
// A law decides nothing but the override it wants. Limits, slew, rounding, air cut and lost
// estimates are dealt with around it (control_path.hpp), and it learns of them from one number,
// the override that really acted. Bumpless switching follows from Mode: a law that is not in
// charge still runs every tick and follows the override of whoever is, so that its first own
// answer continues from there. This holds for enabling, for the end of an air cut and for a held
// estimate. A law that did not run, because another was chosen, catches up (law_set.hpp).
#pragma once

#include <concepts>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "control/cut_state.hpp"

namespace cutforce::control {

enum class LawMode : std::uint8_t {
  kActive,  // in charge: the answer is used
  kTrack,   // another decides, the force is new: follow the override, remember the force
  kHold,    // another decides, the force is not to be learned from: follow the override only
};

struct LawInput {
  float force_reference_n;
  float force_n;                 // finite and >= 0, always; the last good one in kHold
  float force_sigma_n;           // finite and >= 0
  float override_applied_pct;    // acted over the interval that produced force_n
  float override_tolerance_pct;  // a wanted override this close to the applied one was only rounded
  float spindle_ratio;           // spindle speed over the programmed one; 1 where not known
  CutPhase phase;
  LawMode mode;
  bool part_start;  // the program of a part, or a repeated block of it, starts with this tick
};

struct LawOutput {
  float override_pct;  // wanted, before limits, slew and rounding; the applied one unless kActive
  // What a law that estimates the process publishes of it; 0 where it does not.
  float process_gain_n_pct;        // force over override, static
  float process_gain_sigma_ratio;  // standard deviation of that, relative
  float stability_margin_ratio;    // the process gain may be this many times the estimated one
};

// The answer of a law that estimates nothing.
[[nodiscard]] constexpr LawOutput law_answer(float override_pct) noexcept {
  return {.override_pct = override_pct,
          .process_gain_n_pct = 0.0F,
          .process_gain_sigma_ratio = 0.0F,
          .stability_margin_ratio = 0.0F};
}

// A law that predicts the force from the override it sent says so with
// `static constexpr bool kForesees = true`, or with `bool foresees() const noexcept` where it may
// change. It is asked in the air too, where its answer is an upper bound of the approach, and while
// the force falls or the cut may be over, where its answer may only lower; it knows which fall is
// its own doing, and must itself not rise after one that is not. For any other law a steep fall is
// taken for a broken tool (cut_state.hpp).
template <class L>
[[nodiscard]] constexpr bool foresees(const L& law) noexcept {
  if constexpr (requires { law.foresees(); }) {
    return law.foresees();
  } else if constexpr (requires { L::kForesees; }) {
    return L::kForesees;
  } else {
    return false;
  }
}

template <class L>
concept Law = std::is_trivially_copyable_v<L> && std::is_trivially_copyable_v<typename L::State> &&
    requires(L& law, const L& fixed, const LawInput& input, const typename L::Config& config,
             const typename L::State& state) {
  { L::make(config) } -> std::same_as<std::expected<L, typename L::ConfigError>>;
  { law.step(input) }
  noexcept->std::same_as<LawOutput>;
  { fixed.state() }
  noexcept->std::convertible_to<typename L::State>;
  { law.restore(state) }
  noexcept;
};

}  // namespace cutforce::control
