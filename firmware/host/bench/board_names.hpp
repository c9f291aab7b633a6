// What the numbers in the board's frames are called, for a person at the CNC.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "control/supervisor.hpp"

namespace cutforce::firmware::host {

inline constexpr std::array<std::string_view, control::kSupervisorStateCount> kBoardStateNames{
    "boot", "self_test", "check",   "ready", "monitor", "control",
    "hold", "link_lost", "protect", "safe",  "dead"};

inline constexpr std::array<std::string_view, control::kReasonCount> kReasonNames{
    "none",        "self_test_failed", "check_failed",  "link_timeout",
    "bus_down",    "samples_missing",  "estimate_lost", "signal_fault",
    "force_limit", "inhibited",        "threading",     "spindle",
    "overrun",     "output",           "foreign",       "stopped"};

// A frame may say what this program does not know yet.
[[nodiscard]] constexpr std::string_view board_state_name(std::uint8_t state) noexcept {
  return state < kBoardStateNames.size() ? kBoardStateNames[state] : "unknown";
}
[[nodiscard]] constexpr std::string_view reason_name(std::uint8_t reason) noexcept {
  return reason < kReasonNames.size() ? kReasonNames[reason] : "unknown";
}

}  // namespace cutforce::firmware::host
