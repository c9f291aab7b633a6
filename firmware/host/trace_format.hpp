// A trace, version 1: INTERFACES.md section 2 as tables, for the writer and the reader.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "firmware/loop_output.hpp"

namespace cutforce::firmware::host {

inline constexpr std::string_view kTraceFirstLine = "# cutforce trace 1";

// In the order of enum Source and enum LoopState.
inline constexpr std::array<std::string_view, 5> kSourceNames{"", "measured", "computed", "fused",
                                                              "dynamometer"};
inline constexpr std::array<std::string_view, 5> kStateNames{"starting", "no_estimate", "air",
                                                             "cut", "refused"};

enum class TraceRole : std::uint8_t { kTime, kNumber, kSource, kState, kFault };

struct TraceColumn {
  std::string_view name;
  TraceRole role;
  float LoopOutput::*number;  // of kNumber only
  std::uint32_t present;      // bit of LoopOutput::Value that says whether it is there
};

constexpr TraceColumn trace_number(std::string_view name, float LoopOutput::*number,
                                   LoopOutput::Value present) noexcept {
  return {name, TraceRole::kNumber, number, present};
}

// In the order in which they are written.
inline constexpr std::array<TraceColumn, 13> kTraceColumns{
    TraceColumn{"t_s", TraceRole::kTime, nullptr, 0},
    trace_number("airgap_power_w", &LoopOutput::airgap_power_w, LoopOutput::kAirGapPower),
    trace_number("measured_power_w", &LoopOutput::measured_power_w, LoopOutput::kMeasuredPower),
    trace_number("airgap_torque_nm", &LoopOutput::airgap_torque_nm, LoopOutput::kAirGapTorque),
    trace_number("load_torque_nm", &LoopOutput::load_torque_nm, LoopOutput::kLoadTorque),
    trace_number("cutting_torque_nm", &LoopOutput::cutting_torque_nm, LoopOutput::kCuttingTorque),
    trace_number("cutting_torque_sigma_nm", &LoopOutput::cutting_torque_sigma_nm,
                 LoopOutput::kCuttingTorque),
    trace_number("cutting_force_n", &LoopOutput::cutting_force_n, LoopOutput::kCuttingForce),
    trace_number("cutting_force_sigma_n", &LoopOutput::cutting_force_sigma_n,
                 LoopOutput::kCuttingForce),
    TraceColumn{"source", TraceRole::kSource, nullptr, 0},
    trace_number("override_pct", &LoopOutput::override_pct, LoopOutput::kOverride),
    TraceColumn{"state", TraceRole::kState, nullptr, 0},
    TraceColumn{"fault", TraceRole::kFault, nullptr, 0},
};

inline constexpr char kFaultSeparator = '|';

}  // namespace cutforce::firmware::host
