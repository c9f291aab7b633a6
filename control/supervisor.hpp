// Who may move the feed, and what goes out when nobody may: states, edges, latches and time-outs
// between the controller and the lines. One table of transitions (supervisor_table.hpp) says which
// event leads from which state to which; this block makes the events from levels and times.
//
//   kBoot -> kSelfTest -> kCheck -> kReady -> kMonitor -> kControl <-> kHold
//                            kLinkLost, kProtect, kSafe: latched;  kDead: for good
//
// Rules: a fault never raises the feed; only downward transitions are automatic; nothing resumes by
// itself but kHold; arming, control and reset are rising edges; monitor is the default. Source and
// reasons: SUPERVISOR.md.
//
// It is stepped once an estimate period, by the samples where they come and by the board's clock
// where they do not; the period is all it knows of time.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>
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

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept;
  };

  struct Input {
    // The board's own health
    bool self_test_done;
    bool self_test_passed;
    bool checks_passed;          // configuration, lines and bus are as the machine file says
    bool output_failed;          // byte or frame could not be handed over
    bool foreign;                // our own identifier, from another node
    bool stop;                   // the service ends: to kSafe, for good
    std::uint32_t missed_ticks;  // since the last step
    // The link
    bool machine_state_new;  // an accepted frame since the last step
    bool bus_down;
    // What the CNC says; levels, of the last accepted frame
    bool arm;
    bool control;
    bool reset;
    bool inhibit;  // of the line, or of a frame
    bool threading;
    bool spindle_at_speed;
    bool feeding;
    // The samples and what the loop made of them
    bool sample_new;
    bool signals_refused;       // the health monitor will not have them
    bool reversed;              // the spindle turns the other way than it did
    bool force_new;             // a force estimate since the last step
    float force_n;              // of that estimate
    float force_limit_n;        // 0: there is none
    std::uint8_t override_pct;  // the controller's, as it would be sent
  };

  struct Output {
    SupervisorState state;
    Reason reason;
    std::uint8_t override_pct;  // what goes out
    bool controlling;           // the override is the controller's
    bool alive;                 // whether the alive line may toggle
    bool alarm;
    bool silent;            // nothing more on the bus
    Permission permission;  // for the next control tick; floor and reference are neutral here
    bool changed;           // the state or the reason is another than before this step
  };

  [[nodiscard]] static std::expected<Supervisor, ConfigError> make(const Config& config) noexcept;
  [[nodiscard]] Output step(const Input& input) noexcept;
};

}  // namespace cutforce::control
