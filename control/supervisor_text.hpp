// States and reasons in words, for logs, pages and people: a name, what it is, and for a reason
// what to do. The same text stands in SUPERVISOR.md.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "control/supervisor.hpp"

namespace cutforce::control {

struct StateText {
  std::string_view name;
  std::string_view sentence;
};

struct ReasonText {
  std::string_view name;
  std::string_view sentence;
  std::string_view remedy;
};

inline constexpr std::array<StateText, kSupervisorStateCount> kStateTexts{{
    {"boot", "The board starts."},
    {"self_test", "The board tests itself; the lines are left to their pull resistors."},
    {"check", "Configuration, lines and bus are checked; the override is neutral."},
    {"ready", "Waits to be armed; the override is neutral or on its way there."},
    {"monitor", "Armed: estimates and advises; the override is neutral or on its way there."},
    {"control", "The override is the controller's."},
    {"hold", "Control is suspended: the override stays or falls."},
    {"link_lost", "The CNC is not heard: the override falls to its fallback and waits."},
    {"protect", "Feed-hold request: the force was beyond its hard limit."},
    {"safe", "A fault: the override falls to its fallback, the alive line is still."},
    {"dead", "The end: nothing leaves this state but a new start."},
}};

inline constexpr std::array<ReasonText, kReasonCount> kReasonTexts{{
    {"none", "Nothing is wrong.", "Nothing is to be done."},
    {"self_test_failed", "The board's own test has failed.",
     "Read in the log which test it was; start again, and exchange the board if it stays."},
    {"check_failed", "Configuration, lines, bus or sample rate are not as the machine file says.",
     "Compare sample_rate_hz with what the source gives, and run cutforced --check."},
    {"link_timeout", "The CNC has sent no new MachineState for longer than link_timeout_s.",
     "Check that the CNC sends every 20 ms with a running counter and the right node id; then give "
     "a new rising edge of arm."},
    {"bus_down", "The CAN bus is off, nobody answers, or the interface is down.",
     "Check cable, termination and bit rate; then give a new rising edge of arm."},
    {"samples_missing", "The source of the samples gives none.",
     "Check the converter or the acquisition node and its cable; then lower arm and reset."},
    {"estimate_lost", "Samples come, but there was no force for longer than estimate_timeout_s.",
     "Check that the spindle turns above minimum_speed_rad_s and that its diameter is known; then "
     "lower arm and reset."},
    {"signal_fault", "The signals cannot carry an estimate.",
     "Read in the trace which channel is at fault and check its wiring; then lower arm and reset."},
    {"force_limit", "The force was beyond force_limit_n.",
     "Look at tool and workpiece; stop the feed, wait until the force is below half of the limit, "
     "and reset."},
    {"inhibited", "The CNC forbids control.", "Take the inhibit away."},
    {"threading", "Threading, tapping, or the spindle has reversed.",
     "Wait for the end of the cycle; do not use control where the feed is bound to the spindle."},
    {"spindle", "The spindle is not at its programmed speed.", "Wait for the spindle."},
    {"overrun", "The loop has missed ticks.",
     "Look for other load on the board, and for a kernel without real-time scheduling."},
    {"output", "The override byte or a CAN frame could not be written.",
     "Check that no other program holds the lines or the bus; then lower arm and reset."},
    {"foreign", "Another node sends with the board's own identifiers.",
     "Give each node an id of its own; then lower arm and reset."},
    {"stopped", "The service was told to end.", "Start it again; it comes up without control."},
}};

[[nodiscard]] constexpr const StateText& text_of(SupervisorState state) noexcept {
  return kStateTexts[static_cast<std::size_t>(state)];
}
[[nodiscard]] constexpr const ReasonText& text_of(Reason reason) noexcept {
  return kReasonTexts[static_cast<std::size_t>(reason)];
}

}  // namespace cutforce::control
