// One control tick: from the force estimate to the byte on the port. Equation (C11).
//
//   force_input -> cut_state -> law -> feed_override -> override_code
//                     applied_override ^ (what the CNC reports, where it does)
//
// Who decides the override, the first line that holds:
//   not enabled, or no good estimate since the start     the neutral value; not controlling
//   the estimate is lost                                 falls to min(fallback, last), never up
//   the estimate is held                                 stays
//   air                                                  the approach value, or less if the law
//                                                        foresees less
//   exit not confirmed, or the force falls steeply       stays, or falls if the law foresees it
//   entry, cut                                           the law
// Every change goes through limits, slew and rounding, so that taking over and giving back are
// free of jumps; the law follows what was sent while another line decides (law.hpp). While the
// loop controls, nothing but a fresh estimate lets the override rise.
//
// The permission (permission.hpp) is a set of levels here: it can forbid the controller or any
// rise, narrow the range of the override, and name another force to hold, for this tick. Who may
// permit what, edges, latches and the feed-hold request on the hard force limit belong to the
// supervisor.
#pragma once

#include <algorithm>
#include <concepts>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "control/applied_override.hpp"
#include "control/cut_state.hpp"
#include "control/feed_override.hpp"
#include "control/force_input.hpp"
#include "control/law.hpp"
#include "control/law_set.hpp"
#include "control/override_code.hpp"
#include "control/permission.hpp"

namespace cutforce::control {

template <Law L>
class BasicControlPath {
 public:
  enum class ConfigError : std::uint8_t {
    kReference,  // not a force above 0 and below force_input.highest_n
    kPeriods,    // the parts have different periods
    kApproach,   // approach, neutral or fallback outside 0..254
    kFall,       // fall rate not above 0
    kCode,       // the code cannot say the ceiling or the step
    kInitial,    // applied_override and feed_override start differently
    kForceInput,
    kCutState,
    kLaw,
    kFeedOverride,
    kAppliedOverride,
  };

  struct Config {
    float force_reference_n;
    float approach_pct;  // in the air; 100..130 advised, the ceiling for the fastest approach
    float neutral_pct;   // while not controlling; 100
    float fallback_pct;  // without an estimate; 70
    float fall_pct_s;    // on the way there; 5
    OverrideCode code;
    ForceInput::Config force_input;
    CutState::Config cut_state;
    typename L::Config law;
    FeedOverride::Config feed_override;
    AppliedOverride::Config applied_override;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(force_reference_n > 0.0F && force_reference_n < force_input.highest_n))
        return std::unexpected{ConfigError::kReference};
      if (!(percent(approach_pct) && percent(neutral_pct) && percent(fallback_pct)))
        return std::unexpected{ConfigError::kApproach};
      if (!(fall_pct_s > 0.0F && fall_pct_s <= 1e6F)) return std::unexpected{ConfigError::kFall};
      if (!force_input.check()) return std::unexpected{ConfigError::kForceInput};
      if (!cut_state.check()) return std::unexpected{ConfigError::kCutState};
      if (!law.check()) return std::unexpected{ConfigError::kLaw};
      if (!feed_override.check()) return std::unexpected{ConfigError::kFeedOverride};
      if (!applied_override.check()) return std::unexpected{ConfigError::kAppliedOverride};
      if (!(same(cut_state.period_s, feed_override.period_s) &&
            same(law.period_s, feed_override.period_s)))
        return std::unexpected{ConfigError::kPeriods};
      if (feed_override.highest() > highest_pct(code) ||
          feed_override.step_pct % step_pct(code) != 0)
        return std::unexpected{ConfigError::kCode};
      if (FeedOverride::make(feed_override)->sent_pct() != applied_override.initial_pct)
        return std::unexpected{ConfigError::kInitial};
      return {};
    }

   private:
    [[nodiscard]] static constexpr bool percent(float value) noexcept {
      return value >= 0.0F && value <= 254.0F;
    }
    [[nodiscard]] static constexpr bool same(float a, float b) noexcept { return a <= b && a >= b; }
  };

  struct Input {
    float force_n;
    float force_sigma_n;
    std::uint32_t force_age_ticks;  // control ticks since the estimate was made; 0: this tick's
    float override_reported_pct;
    float spindle_ratio;     // spindle speed over the programmed one; 1 where not known
    bool force_valid;        // false: there is no estimate
    bool override_reported;  // false: the CNC tells nothing
    Permission permission;
    bool part_start;  // the program of a part starts
  };

  struct Output {
    std::uint8_t override_pct;   // sent
    std::uint8_t override_code;  // the byte on the port
    bool controlling;
    bool saturated_low;     // controlling, and the floor acts
    bool saturated_high;    // controlling, and the ceiling acts
    bool in_cut;            // not in the air; stays until the end of the cut is confirmed
    bool override_follows;  // false: the CNC reports another override than was sent
    CutPhase phase;
    ForceOutcome force;
    ForceRefusal refusal;
    std::uint32_t limits;  // set of OverrideLimit
    float wanted_pct;      // before limits, slew and rounding
    LawOutput law;         // with what it publishes of the process
  };

  struct State {
    ForceInput::State force_input;
    CutState::State cut_state;
    typename L::State law;
    FeedOverride::State feed_override;
    AppliedOverride::State applied_override;
    float fall_pct;         // where the fall has got to, while the estimate is lost
    std::uint32_t started;  // 1 after the first good estimate
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<BasicControlPath, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return BasicControlPath{config};
  }
  // Of a config that check() accepts, made where it stays.
  [[nodiscard]] static constexpr BasicControlPath make_checked(const Config& config) noexcept {
    return BasicControlPath{config};
  }

  // Inlined where it is stepped: neither input nor output is put together in memory then.
  [[nodiscard]] [[gnu::always_inline]] constexpr Output step(const Input& input) noexcept {
    const auto force = force_input_.step({.force_n = input.force_n,
                                          .force_sigma_n = input.force_sigma_n,
                                          .age_ticks = input.force_age_ticks,
                                          .valid = input.force_valid});
    const bool fresh = force.outcome == ForceOutcome::kFresh;
    const float force_reference_n = reference(input.permission.force_reference_n);
    const auto cut = cut_state_.step(
        {.force_n = force.force_n, .force_reference_n = force_reference_n, .fresh = fresh});
    const auto applied = applied_override_.step({.sent_pct = feed_override_.sent_pct(),
                                                 .reported_pct = input.override_reported_pct,
                                                 .reported = input.override_reported});
    if (fresh) started_ = 1;
    const Decision decision = decide(input.permission.enable && started_ != 0, force.outcome, cut);

    const auto law = law_.step({.force_reference_n = force_reference_n,
                                .force_n = force.force_n,
                                .force_sigma_n = force.force_sigma_n,
                                .override_applied_pct = applied.applied_pct,
                                .override_tolerance_pct = feed_override_.tolerance_pct(),
                                .spindle_ratio = input.spindle_ratio,
                                .phase = cut.phase,
                                .mode = decision.mode,
                                .part_start = input.part_start});
    // In the air, and while the cut may be over, the law's answer is an upper bound.
    const float wanted_pct = decision.mode == LawMode::kActive
                                 ? std::min(law.override_pct, decision.wanted_pct)
                                 : decision.wanted_pct;
    const auto sent =
        feed_override_.step({.wanted_pct = wanted_pct,
                             .may_rise = decision.may_rise && input.permission.may_rise,
                             .ceiling_pct = input.permission.ceiling_pct,
                             .floor_pct = input.permission.floor_pct});
    return {.override_pct = sent.override_pct,
            .override_code = encode(code_, sent.override_pct),
            .controlling = decision.controlling,
            .saturated_low = decision.controlling && (sent.limits & kFloorLimit) != 0,
            .saturated_high = decision.controlling && (sent.limits & kCeilingLimit) != 0,
            .in_cut = cut.phase != CutPhase::kAir,
            .override_follows = applied.follows,
            .phase = cut.phase,
            .force = force.outcome,
            .refusal = force.refusal,
            .limits = sent.limits,
            .wanted_pct = wanted_pct,
            .law = law};
  }

  // Puts another law in charge from the next step on (law_set.hpp).
  constexpr void select(LawName name) noexcept requires std::same_as<L, LawSet> {
    law_.select(name);
  }

  [[nodiscard]] constexpr State state() const noexcept {
    return {.force_input = force_input_.state(),
            .cut_state = cut_state_.state(),
            .law = law_.state(),
            .feed_override = feed_override_.state(),
            .applied_override = applied_override_.state(),
            .fall_pct = fall_pct_,
            .started = started_};
  }
  constexpr void restore(const State& state) noexcept {
    force_input_.restore(state.force_input);
    cut_state_.restore(state.cut_state);
    law_.restore(state.law);
    feed_override_.restore(state.feed_override);
    applied_override_.restore(state.applied_override);
    fall_pct_ = state.fall_pct;
    started_ = state.started;
  }

 private:
  static constexpr float kHighest_pct = 1e6F;  // no bound; a law that is not finite stays visible

  struct Decision {
    float wanted_pct;
    LawMode mode;
    bool may_rise;
    bool controlling;
  };

  // A set of laws is too large to be copied from an expected one.
  [[nodiscard]] static constexpr L checked_law(const typename L::Config& config) noexcept {
    if constexpr (requires { L::make_checked(config); }) {
      return L::make_checked(config);
    } else {
      return *L::make(config);
    }
  }

  // config has passed check(): every part can be made.
  explicit constexpr BasicControlPath(const Config& config) noexcept
      : force_reference_n_(config.force_reference_n),
        approach_pct_(config.approach_pct),
        neutral_pct_(config.neutral_pct),
        fallback_pct_(config.fallback_pct),
        fall_pct_per_tick_(config.fall_pct_s * config.feed_override.period_s),
        code_(config.code),
        highest_n_(config.force_input.highest_n),
        force_input_(*ForceInput::make(config.force_input)),
        cut_state_(*CutState::make(config.cut_state)),
        feed_override_(*FeedOverride::make(config.feed_override)),
        applied_override_(*AppliedOverride::make(config.applied_override)),
        law_(checked_law(config.law)) {}

  // The permitted force to hold, if there is one; NaN is none.
  [[nodiscard]] constexpr float reference(float permitted_n) const noexcept {
    return permitted_n > 0.0F ? std::min(permitted_n, highest_n_) : force_reference_n_;
  }

  // The table at the top of this file, in its order.
  [[nodiscard]] constexpr Decision decide(bool controlling, ForceOutcome force,
                                          const CutState::Output& cut) noexcept {
    const auto sent_pct = static_cast<float>(feed_override_.sent_pct());
    const bool fresh = force == ForceOutcome::kFresh;
    const Decision stay{.wanted_pct = sent_pct,
                        .mode = LawMode::kHold,
                        .may_rise = false,
                        .controlling = controlling};
    const float fall_pct = fall_pct_;
    fall_pct_ = sent_pct;

    if (!controlling) {
      return {.wanted_pct = neutral_pct_,
              .mode = fresh ? LawMode::kTrack : LawMode::kHold,
              .may_rise = true,
              .controlling = false};
    }
    if (force == ForceOutcome::kLost) {
      // From where the fall has got to, which is between two steps; from what was sent at its
      // begin.
      const float fallen_pct =
          std::min(fall_pct, sent_pct + feed_override_.tolerance_pct()) - fall_pct_per_tick_;
      fall_pct_ = std::max(fallen_pct, std::min(fallback_pct_, sent_pct));  // (C11)
      Decision fall = stay;
      fall.wanted_pct = fall_pct_;
      return fall;
    }
    if (!fresh) return stay;
    constexpr auto kLaw = LawMode::kActive;
    switch (cut.phase) {
      case CutPhase::kAir:
        return {.wanted_pct = approach_pct_,
                .mode = foresees(law_) ? kLaw : LawMode::kTrack,
                .may_rise = true,
                .controlling = true};
      case CutPhase::kEntry:
      case CutPhase::kCut:
        if (cut.falling && !foresees(law_)) return stay;
        return {.wanted_pct = kHighest_pct, .mode = kLaw, .may_rise = true, .controlling = true};
      case CutPhase::kExit:
        if (!foresees(law_)) return stay;
        return {.wanted_pct = sent_pct, .mode = kLaw, .may_rise = false, .controlling = true};
    }
    return stay;
  }

  float force_reference_n_;
  float approach_pct_;
  float neutral_pct_;
  float fallback_pct_;
  float fall_pct_per_tick_;
  OverrideCode code_;
  float highest_n_;
  ForceInput force_input_;
  CutState cut_state_;
  FeedOverride feed_override_;
  AppliedOverride applied_override_;
  float fall_pct_ = 0.0F;
  std::uint32_t started_ = 0;
  L law_;  // last: a set of laws is large, and all else within a short reach
};

using ControlPath = BasicControlPath<LawSet>;
extern template class BasicControlPath<LawSet>;  // in control_path.cpp, whoever else uses it

static_assert(std::is_trivially_copyable_v<ControlPath>);
static_assert(std::is_trivially_copyable_v<ControlPath::State> &&
              std::is_standard_layout_v<ControlPath::State>);
static_assert(sizeof(ControlPath::State) ==
              sizeof(ForceInput::State) + sizeof(CutState::State) + sizeof(LawSet::State) +
                  sizeof(FeedOverride::State) + sizeof(AppliedOverride::State) + 8);

}  // namespace cutforce::control
