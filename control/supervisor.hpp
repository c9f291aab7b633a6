// Who may move the feed, and what goes out when nobody may: states, edges, latches and time-outs
// between the controller and the lines. One table of transitions (supervisor_table.hpp) says which
// event leads from which state to which; this block makes the events from levels and times.
//
//   kBoot -> kSelfTest -> kCheck -> kReady -> kMonitor -> kControl <-> kHold
//                            kLinkLost, kProtect, kSafe: latched;  kDead: for good
//
// Rules: a fault never raises the feed; only downward transitions are automatic; nothing resumes by
// itself but kHold; arming, control and reset are rising edges, of a level seen low in that very
// state; monitor is the default. Source and reasons: SUPERVISOR.md.
//
// What goes out:
//   kBoot, kSelfTest, kCheck  as it was; neutral at the start
//   kReady, kMonitor          the controller's, who is off and goes to neutral at its own slew
//   rate,
//                             so that giving back is free of jumps; never above neutral from below
//   kControl                  the controller's
//   kHold                     the lowest since the hold began; where the CNC forbids control or
//   cuts
//                             a thread the controller is off, and it is min(last, neutral)
//   kLinkLost, kSafe, kDead   min(last, neutral), and if the controller had moved it, down from
//   there
//                             with fall_pct_s to min(last, fallback); kDead does not wait for that
//   kProtect                  min(last, hold), at once
// The output does not rise in the step of any transition, and never above the controller's. The
// permission's ceiling keeps the controller at what went out, to the ends of its own range.
//
// It is stepped once an estimate period, by the samples where they come and by the board's clock
// where they do not; the period is all it knows of time. Missed ticks make everything older that is
// waited for, and never end a hold sooner. Time-outs are whole steps, the nearest, one at least.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "control/permission.hpp"

namespace cutforce::control {

enum class SupervisorState : std::uint8_t {
  kBoot,
  kSelfTest,
  kCheck,
  kReady,
  kMonitor,
  kControl,
  kHold,
  kLinkLost,
  kProtect,
  kSafe,
  kDead,
};
inline constexpr unsigned kSupervisorStateCount = 11;

// Why the state is what it is, or why something was refused. On the bus as a number: append only.
enum class Reason : std::uint8_t {
  kNone,
  kSelfTestFailed,
  kCheckFailed,
  kLinkTimeout,     // no new MachineState for too long
  kBusDown,         // bus-off, passive without an answer, or the interface is down
  kSamplesMissing,  // the source gives no samples
  kEstimateLost,    // samples, but no force for too long
  kSignalFault,     // the signals cannot carry an estimate (LoopState::kRefused)
  kForceLimit,      // beyond the hard limit: feed-hold request
  kInhibited,       // the CNC forbids control
  kThreading,       // threading, tapping, or a reversal
  kSpindle,         // not at speed
  kOverrun,         // ticks were missed
  kOutput,          // byte or CAN could not be written
  kForeign,         // another node uses our identifiers
  kStopped,         // the service was told to end
};
inline constexpr unsigned kReasonCount = 16;

struct Transition;  // supervisor_table.hpp

enum class SupervisorMode : std::uint8_t {
  kAdvise,   // never beyond kMonitor
  kControl,  // the CNC may give control
};

class Supervisor {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kTime, kOverride, kFall, kRelease };

  struct Config {
    float period_s;
    SupervisorMode mode;
    bool link_required;        // a CNC that sends MachineState; false: enable comes from the lines
    float neutral_pct;         // 100
    float fallback_pct;        // 70: where the override falls to after a fault, never from below
    float hold_pct;            // 0: the feed-hold request
    float fall_pct_s;          // 5
    float link_timeout_s;      // 0.25, since the last new MachineState
    float samples_timeout_s;   // without a sample
    float estimate_timeout_s;  // in control, without a force; the controller falls back before that
    float hold_release_s;      // 0.5, since the cause of kHold has gone
    float overrun_window_s;    // 1
    float overrun_ratio;       // 0.01 of the ticks in the window; or three in a row

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s >= 1e-5F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(time(link_timeout_s) && time(samples_timeout_s) && time(estimate_timeout_s) &&
            time(overrun_window_s)))
        return std::unexpected{ConfigError::kTime};
      if (!(overrun_ratio > 0.0F && overrun_ratio <= 1.0F))
        return std::unexpected{ConfigError::kTime};
      if (!(percent(neutral_pct) && percent(fallback_pct) && percent(hold_pct)))
        return std::unexpected{ConfigError::kOverride};
      if (!(fall_pct_s > 0.0F && fall_pct_s <= 1e6F)) return std::unexpected{ConfigError::kFall};
      if (!time(hold_release_s)) return std::unexpected{ConfigError::kRelease};
      return {};
    }

   private:
    [[nodiscard]] static constexpr bool percent(float value) noexcept {
      return value >= 0.0F && value <= 254.0F;
    }
    [[nodiscard]] static constexpr bool time(float value) noexcept {
      return value > 0.0F && value <= 3600.0F;
    }
  };

  struct Input {
    // The board's own health
    bool self_test_done;
    bool self_test_passed;
    bool checks_passed;       // configuration, lines and bus are as the machine file says
    bool checks_done = true;  // false: it is too early to tell, and nothing has failed
    // Eight that are false where all is well: read as two words, see in_order()
    bool output_failed;  // byte or frame could not be handed over
    bool foreign;        // our own identifier, from another node
    bool stop;           // the service ends: to kDead, for good
    bool bus_down;
    bool inhibit;          // of the line, or of a frame
    bool threading;        // as the CNC says
    bool signals_refused;  // the health monitor will not have them
    bool reversed;         // the spindle turns the other way than it did
    // What the CNC says; levels, of the last accepted frame
    bool arm;
    bool control;
    bool reset;
    bool spindle_at_speed;
    bool feeding;
    // What is new since the last step
    bool machine_state_new;  // an accepted frame
    bool sample_new;
    bool force_new;  // a force estimate
    std::uint32_t missed_ticks;
    float force_n;              // of that estimate
    float force_limit_n;        // 0: there is none
    std::uint8_t override_pct;  // the controller's, as it would be sent
  };

  // What a state says to the world.
  struct Outward {
    bool controlling;  // the override is the controller's
    bool alive;        // whether the alive line may toggle
    bool alarm;
    bool silent;            // nothing more on the bus
    Permission permission;  // for the next control tick; floor and reference are neutral here
  };

  struct Output : Outward {
    SupervisorState state;
    Reason reason;
    std::uint8_t override_pct;  // what goes out
    bool changed;               // the state or the reason is another than before this step
  };

  static constexpr std::uint32_t kNever = 1'000'000'000;  // an age; steps
  static constexpr std::uint32_t kArmBit = 1;
  static constexpr std::uint32_t kControlBit = 2;
  static constexpr std::uint32_t kResetBit = 4;
  static constexpr std::uint32_t kAllButtons = kArmBit | kControlBit | kResetBit;

  struct State {
    SupervisorState state;
    Reason reason;
    std::uint8_t override_pct;  // as it went out
    std::uint8_t lows;          // levels seen low in this state
    std::uint32_t controlled;   // 1: in control, or was when the fault came
    std::uint32_t forces_over;  // of the last three, a bit each
    float force_n;              // the last one
    float position_pct;         // of the fall
    float fall_to_pct;
    std::uint32_t link_age;  // steps since a new frame; and so on
    std::uint32_t sample_age;
    std::uint32_t force_age;
    std::uint32_t estimate_age;  // the same, in kControl alone
    std::uint32_t calm_steps;    // without a cause to hold
    std::uint32_t missed_run;    // ticks missed in a row
    std::uint32_t window_steps;  // in the newest eighth of the window
    std::uint32_t window_part;   // which that is
    std::array<std::uint32_t, 8> missed;
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<Supervisor, ConfigError> make(
      const Config& config) noexcept;
  [[nodiscard]] Output step(const Input& input) noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept {
    state_ = state;
    sum_missed();
  }

 private:
  explicit constexpr Supervisor(const Config& config) noexcept;

  [[nodiscard]] constexpr std::uint32_t steps(float time_s) const noexcept;
  [[nodiscard]] Output step_on(const Transition* row, std::uint32_t events,
                               const Input& input) noexcept;
  // In supervisor_events.cpp: what happens in this step, EventSet of supervisor_table.hpp.
  [[nodiscard]] std::uint32_t events(const Input& input) noexcept;
  [[nodiscard]] std::uint32_t all_events(const Input& input, bool overran) noexcept;
  [[nodiscard]] bool in_order(const Input& input, bool overran) const noexcept;
  void note_ages(const Input& input) noexcept;
  [[nodiscard]] bool note_missed(std::uint32_t missed_ticks) noexcept;
  void slide_window(std::uint32_t missed_ticks) noexcept;
  void sum_missed() noexcept;
  [[nodiscard]] bool protect_clear(const Input& input) const noexcept;
  [[nodiscard]] bool safe_clear(const Input& input) const noexcept;
  [[nodiscard]] std::uint32_t faults(const Input& input) const noexcept;
  [[nodiscard]] std::uint32_t tests(const Input& input) const noexcept;
  [[nodiscard]] std::uint32_t holds(const Input& input, bool overran) const noexcept;
  [[nodiscard]] std::uint32_t requests(const Input& input) const noexcept;
  // Which are pressed now, bit by bit.
  [[nodiscard]] static constexpr std::uint32_t buttons(const Input& input) noexcept {
    return (input.arm ? kArmBit : 0U) | (input.control ? kControlBit : 0U) |
           (input.reset ? kResetBit : 0U);
  }
  void enter(SupervisorState before, bool force_over) noexcept;
  [[nodiscard]] std::uint32_t following(std::uint32_t controller_pct) const noexcept;
  [[nodiscard]] bool controller_off() const noexcept;
  [[nodiscard]] Outward outward(bool bus_down) const noexcept;

  Config config_;
  std::uint32_t link_steps_;
  std::uint32_t samples_steps_;
  std::uint32_t estimate_steps_;
  std::uint32_t release_steps_;
  std::uint32_t window_part_steps_;
  float missed_most_;
  std::uint32_t edges_allowed_;  // of the buttons; advising, there is none of kControlBit
  std::uint8_t neutral_pct_;
  bool missed_too_many_ = false;  // in the window: the sum of State::missed against missed_most_
  State state_{};
};

constexpr auto Supervisor::make(const Config& config) noexcept
    -> std::expected<Supervisor, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return Supervisor{config};
}

constexpr Supervisor::Supervisor(const Config& config) noexcept
    : config_(config),
      link_steps_(config.link_required ? steps(config.link_timeout_s) : kNever),
      samples_steps_(steps(config.samples_timeout_s)),
      estimate_steps_(steps(config.estimate_timeout_s)),
      release_steps_(steps(config.hold_release_s)),
      window_part_steps_(std::max<std::uint32_t>(steps(config.overrun_window_s) / 8, 1U)),
      missed_most_(config.overrun_ratio * static_cast<float>(steps(config.overrun_window_s))),
      edges_allowed_(config.mode == SupervisorMode::kControl ? kAllButtons : kArmBit | kResetBit),
      neutral_pct_(static_cast<std::uint8_t>(config.neutral_pct + 0.5F)) {
  state_ = {.state = SupervisorState::kBoot,
            .reason = Reason::kNone,
            .override_pct = neutral_pct_,
            .lows = 0,
            .controlled = 0,
            .forces_over = 0,
            .force_n = 0.0F,
            .position_pct = config.neutral_pct,
            .fall_to_pct = config.neutral_pct,
            .link_age = kNever,
            .sample_age = kNever,
            .force_age = kNever,
            .estimate_age = 0,
            .calm_steps = 0,
            .missed_run = 0,
            .window_steps = 0,
            .window_part = 0,
            .missed = {}};
}

constexpr std::uint32_t Supervisor::steps(float time_s) const noexcept {
  return std::max<std::uint32_t>(static_cast<std::uint32_t>(time_s / config_.period_s + 0.5F), 1U);
}

static_assert(std::is_trivially_copyable_v<Supervisor>);
static_assert(sizeof(Supervisor::State) == 4 + 13 * 4 + 8 * 4);

}  // namespace cutforce::control
