// The table of transitions of the supervisor: in which states, on which events, to which state, and
// why. The first row whose events have all happened, in one of its states, is taken; where none is,
// nothing changes. So the order is that of severity: what makes the board doubt itself, the hard
// limit, the estimate, the link, a person who takes back, what suspends, and last what a person
// asks for.
//
// A row without an event of kByPerson is automatic; static_asserts below hold those to the rule
// that only downward transitions are, but for the start and the end of a hold.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <string_view>

#include "control/supervisor.hpp"

namespace cutforce::control {

using StateSet = std::uint32_t;
[[nodiscard]] constexpr StateSet only(SupervisorState state) noexcept {
  return 1U << static_cast<unsigned>(state);
}
[[nodiscard]] constexpr StateSet from_to(SupervisorState first, SupervisorState last) noexcept {
  return 2U * only(last) - only(first);
}

// What happens in one step, as a set of bits; made of levels and times in supervisor.cpp.
using EventSet = std::uint32_t;
enum Event : EventSet {
  kAlways = 0,
  kStop = 1U << 0,
  kOutputFailed = 1U << 1,
  kForeignNode = 1U << 2,
  kForceOver = 1U << 3,    // two of the last three estimates beyond the limit
  kControlled = 1U << 4,   // the fault came while the override was the controller's
  kSamplesGone = 1U << 5,  // for longer than samples_timeout_s
  kSamplesLate = 1U << 6,  // for longer than half of it
  kSignalsRefused = 1U << 7,
  kEstimateGone = 1U << 8,  // in control, for longer than estimate_timeout_s
  kBusIsDown = 1U << 9,     // with a link required
  kLinkLate = 1U << 10,     // likewise, for longer than link_timeout_s
  kLinkOk = 1U << 11,       // neither of the two
  kInhibit = 1U << 12,
  kThreads = 1U << 13,     // threading, tapping, or the spindle reversed
  kSpindleOff = 1U << 14,  // not at speed
  kOverran = 1U << 15,     // too many ticks missed
  kCalm = 1U << 16,        // no cause of a hold for hold_release_s
  kSelfTestFails = 1U << 17,
  kSelfTestPasses = 1U << 18,
  kChecksFail = 1U << 19,
  kChecksPass = 1U << 20,
  kProtectClear = 1U << 21,  // force below half of the limit, not feeding
  kSafeClear = 1U << 22,     // the cause has gone, arm is low
  kArmLow = 1U << 23,
  kControlLow = 1U << 24,
  kArmEdge = 1U << 25,
  kControlEdge = 1U << 26,  // with mode kControl
  kResetEdge = 1U << 27,
};
inline constexpr unsigned kEventCount = 28;
inline constexpr std::array<std::string_view, kEventCount> kEventNames{
    "stop",
    "output failed",
    "foreign node",
    "force over limit",
    "was in control",
    "samples gone",
    "samples late",
    "signals refused",
    "estimate gone",
    "bus down",
    "link late",
    "link ok",
    "inhibit",
    "threading or reversed",
    "spindle not at speed",
    "overrun",
    "calm",
    "self test fails",
    "self test passes",
    "checks fail",
    "checks pass",
    "clear of the limit",
    "cause gone, arm low",
    "arm low",
    "control low",
    "arm edge",
    "control edge",
    "reset edge",
};
inline constexpr EventSet kByPerson = kArmLow | kControlLow | kArmEdge | kControlEdge | kResetEdge;

[[nodiscard]] constexpr EventSet when(bool holds, EventSet event) noexcept {
  return holds ? event : kAlways;
}

struct Transition {
  StateSet states;
  EventSet events;  // all of them
  SupervisorState next;
  Reason reason;
};

namespace detail {

using S = SupervisorState;
inline constexpr StateSet kAlive = from_to(S::kBoot, S::kSafe);
inline constexpr StateSet kOnTheLines = from_to(S::kReady, S::kProtect);
inline constexpr StateSet kLinked = from_to(S::kReady, S::kHold);
inline constexpr StateSet kInControl = only(S::kControl) | only(S::kHold);

}  // namespace detail

inline constexpr auto kTransitions = std::to_array<Transition>({
    {detail::kAlive, kStop, SupervisorState::kDead, Reason::kStopped},
    {detail::kOnTheLines, kOutputFailed, SupervisorState::kSafe, Reason::kOutput},
    {detail::kOnTheLines, kForeignNode, SupervisorState::kSafe, Reason::kForeign},
    {detail::kInControl, kForceOver, SupervisorState::kProtect, Reason::kForceLimit},
    {only(SupervisorState::kLinkLost), kForceOver | kControlled, SupervisorState::kProtect,
     Reason::kForceLimit},
    {detail::kInControl, kSamplesGone, SupervisorState::kSafe, Reason::kSamplesMissing},
    {detail::kInControl, kSignalsRefused, SupervisorState::kSafe, Reason::kSignalFault},
    {only(SupervisorState::kControl), kEstimateGone, SupervisorState::kSafe, Reason::kEstimateLost},
    {detail::kLinked, kBusIsDown, SupervisorState::kLinkLost, Reason::kBusDown},
    {detail::kLinked, kLinkLate, SupervisorState::kLinkLost, Reason::kLinkTimeout},

    {detail::kInControl | only(SupervisorState::kMonitor), kArmLow, SupervisorState::kReady,
     Reason::kNone},
    {detail::kInControl, kControlLow, SupervisorState::kMonitor, Reason::kNone},
    {detail::kInControl, kInhibit, SupervisorState::kHold, Reason::kInhibited},
    {detail::kInControl, kThreads, SupervisorState::kHold, Reason::kThreading},
    {detail::kInControl, kSpindleOff, SupervisorState::kHold, Reason::kSpindle},
    {detail::kInControl, kOverran, SupervisorState::kHold, Reason::kOverrun},
    {detail::kInControl, kSamplesLate, SupervisorState::kHold, Reason::kSamplesMissing},
    {only(SupervisorState::kHold), kCalm, SupervisorState::kControl, Reason::kNone},

    {only(SupervisorState::kBoot), kAlways, SupervisorState::kSelfTest, Reason::kNone},
    {only(SupervisorState::kSelfTest), kSelfTestFails, SupervisorState::kSelfTest,
     Reason::kSelfTestFailed},
    {only(SupervisorState::kSelfTest), kSelfTestPasses, SupervisorState::kCheck, Reason::kNone},
    {only(SupervisorState::kCheck), kOutputFailed, SupervisorState::kCheck, Reason::kOutput},
    {only(SupervisorState::kCheck), kForeignNode, SupervisorState::kCheck, Reason::kForeign},
    {from_to(SupervisorState::kCheck, SupervisorState::kReady), kChecksFail,
     SupervisorState::kCheck, Reason::kCheckFailed},
    {only(SupervisorState::kCheck), kBusIsDown, SupervisorState::kCheck, Reason::kBusDown},
    {only(SupervisorState::kCheck), kLinkLate, SupervisorState::kCheck, Reason::kLinkTimeout},
    {only(SupervisorState::kCheck), kChecksPass, SupervisorState::kReady, Reason::kNone},
    {only(SupervisorState::kCheck), kLinkOk, SupervisorState::kCheck, Reason::kNone},

    {only(SupervisorState::kReady), kArmEdge, SupervisorState::kMonitor, Reason::kNone},
    {only(SupervisorState::kMonitor), kControlEdge | kForceOver, SupervisorState::kMonitor,
     Reason::kForceLimit},
    {only(SupervisorState::kMonitor), kControlEdge | kSignalsRefused, SupervisorState::kMonitor,
     Reason::kSignalFault},
    {only(SupervisorState::kMonitor), kControlEdge | kSamplesLate, SupervisorState::kMonitor,
     Reason::kSamplesMissing},
    {only(SupervisorState::kMonitor), kControlEdge | kInhibit, SupervisorState::kMonitor,
     Reason::kInhibited},
    {only(SupervisorState::kMonitor), kControlEdge | kThreads, SupervisorState::kMonitor,
     Reason::kThreading},
    {only(SupervisorState::kMonitor), kControlEdge | kSpindleOff, SupervisorState::kMonitor,
     Reason::kSpindle},
    {only(SupervisorState::kMonitor), kControlEdge | kOverran, SupervisorState::kMonitor,
     Reason::kOverrun},
    {only(SupervisorState::kMonitor), kControlEdge, SupervisorState::kControl, Reason::kNone},
    {only(SupervisorState::kMonitor), kForceOver, SupervisorState::kMonitor, Reason::kForceLimit},
    {only(SupervisorState::kMonitor), kResetEdge, SupervisorState::kMonitor, Reason::kNone},
    {only(SupervisorState::kLinkLost), kArmEdge | kLinkOk, SupervisorState::kReady, Reason::kNone},
    {only(SupervisorState::kProtect), kResetEdge | kProtectClear, SupervisorState::kReady,
     Reason::kNone},
    {only(SupervisorState::kSafe), kResetEdge | kSafeClear, SupervisorState::kReady, Reason::kNone},
});

namespace detail {

// One event of each row that leads from the state, a person's where it has one: while none of them
// has happened, no row is taken. 1 above all events stands for the row that needs none.
inline constexpr EventSet kNoEvent = 1U << kEventCount;
[[nodiscard]] constexpr EventSet triggers(SupervisorState state) noexcept {
  EventSet events = 0;
  for (const Transition& row : kTransitions) {
    if ((row.states & only(state)) != 0)
      events |= row.events == kAlways ? kNoEvent : std::bit_floor(row.events);
  }
  return events;
}
inline constexpr auto kTriggers = [] {
  std::array<EventSet, kSupervisorStateCount> all{};
  for (unsigned k = 0; k < all.size(); ++k) all[k] = triggers(static_cast<SupervisorState>(k));
  return all;
}();

}  // namespace detail

// The row that is taken, or null.
[[nodiscard]] constexpr const Transition* transition(SupervisorState state,
                                                     EventSet events) noexcept {
  const EventSet triggers = detail::kTriggers[static_cast<unsigned>(state)];
  if (((events | detail::kNoEvent) & triggers) == 0) [[likely]]
    return nullptr;
  for (const Transition& row : kTransitions) {
    if ((row.states & only(state)) != 0 && (events & row.events) == row.events) return &row;
  }
  return nullptr;
}

namespace detail {

// Where an automatic row may lead from a state: down, or to itself.
[[nodiscard]] constexpr StateSet below(SupervisorState state) noexcept {
  constexpr StateSet kFaults = only(S::kSafe) | only(S::kDead);
  switch (state) {
    case S::kBoot:
      return only(S::kSelfTest) | kFaults;
    case S::kSelfTest:
      return only(S::kSelfTest) | only(S::kCheck) | kFaults;
    case S::kCheck:
      return only(S::kCheck) | only(S::kReady) | kFaults;
    case S::kReady:
      return only(S::kCheck) | only(S::kLinkLost) | kFaults;
    case S::kMonitor:
      return only(S::kMonitor) | only(S::kLinkLost) | kFaults;
    case S::kControl:
      return only(S::kHold) | only(S::kLinkLost) | only(S::kProtect) | kFaults;
    case S::kHold:  // the only state that resumes
      return kInControl | only(S::kLinkLost) | only(S::kProtect) | kFaults;
    case S::kLinkLost:
      return only(S::kProtect) | kFaults;
    case S::kProtect:
      return kFaults;
    case S::kSafe:
      return only(S::kDead);
    case S::kDead:
      break;
  }
  return 0;
}

[[nodiscard]] constexpr bool only_downward_is_automatic() noexcept {
  return std::ranges::all_of(kTransitions, [](const Transition& row) {
    if ((row.events & kByPerson) != 0) return true;
    for (unsigned k = 0; k < kSupervisorStateCount; ++k) {
      const auto state = static_cast<S>(k);
      if ((row.states & only(state)) != 0 && (below(state) & only(row.next)) == 0) return false;
    }
    return true;
  });
}
static_assert(only_downward_is_automatic());

// Each row is the one taken on its own events alone, in each of its states: none is in vain.
[[nodiscard]] constexpr bool no_row_hides_another() noexcept {
  return std::ranges::all_of(kTransitions, [](const Transition& row) {
    for (unsigned k = 0; k < kSupervisorStateCount; ++k) {
      const auto state = static_cast<S>(k);
      if ((row.states & only(state)) != 0 && transition(state, row.events) != &row) return false;
    }
    return true;
  });
}
static_assert(no_row_hides_another());

}  // namespace detail
}  // namespace cutforce::control
