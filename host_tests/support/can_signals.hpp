// The signals of each message by their names in the DBC file, with the member that carries each
// and how many of the DBC's units its own unit has. Written by hand, and only for the tests.
#pragma once

#include "hal/can/messages.hpp"

namespace cutforce::host_tests {

inline void each_signal(hal::can::Override& m, auto&& visit) {
  visit("OverridePct", m.override_pct, 1.0);
  visit("State", m.state, 1.0);
  visit("Reason", m.reason, 1.0);
  visit("Force", m.force_n, 1.0);
  visit("Enabled", m.enabled, 1.0);
  visit("SaturatedLow", m.saturated_low, 1.0);
  visit("SaturatedHigh", m.saturated_high, 1.0);
  visit("InCut", m.in_cut, 1.0);
  visit("Source", m.source, 1.0);
  visit("Limit", m.limit, 1.0);
}

inline void each_signal(hal::can::Estimate& m, auto&& visit) {
  visit("Force", m.force_n, 1.0);
  visit("ForceSigma", m.force_sigma_n, 1.0);
  visit("Reference", m.reference_n, 1.0);
  visit("Power", m.power_w, 1.0);
  visit("StabilityMargin", m.stability_margin_ratio, 1.0);
}

inline void each_signal(hal::can::Diagnostics& m, auto&& visit) {
  visit("ProcessGain", m.process_gain_n_pct, 1.0);
  visit("Wear", m.wear_ratio, 1.0);
  visit("WorstLoop", m.worst_loop_us, 1.0);
  visit("RefusedFrames", m.refused_frames, 1.0);
  visit("UnsentFrames", m.unsent_frames, 1.0);
  visit("LostSamples", m.lost_samples, 1.0);
}

inline void each_signal(hal::can::Emergency& m, auto&& visit) {
  visit("ErrorCode", m.error_code, 1.0);
  visit("ErrorRegister", m.error_register, 1.0);
  visit("State", m.state, 1.0);
  visit("Reason", m.reason, 1.0);
  visit("Detail", m.detail, 1.0);
}

inline void each_signal(hal::can::Heartbeat& m, auto&& visit) {
  visit("NmtState", m.nmt_state, 1.0);
}

inline void each_signal(hal::can::MachineState& m, auto&& visit) {
  visit("Arm", m.arm, 1.0);
  visit("Control", m.control, 1.0);
  visit("Reset", m.reset, 1.0);
  visit("SpindleAtSpeed", m.spindle_at_speed, 1.0);
  visit("CuttingFeed", m.cutting_feed, 1.0);
  visit("Rapid", m.rapid, 1.0);
  visit("Threading", m.threading, 1.0);
  visit("PartStart", m.part_start, 1.0);
  visit("Tool", m.tool, 1.0);
  visit("OverrideApplied", m.override_applied_pct, 1.0);
  visit("Feed", m.feed_m_s, 60000.0);
}

inline void each_signal(hal::can::Job& m, auto&& visit) {
  visit("Reference", m.force_reference_n, 1.0);
  visit("LimitRatio", m.force_limit_ratio, 1.0);
  visit("Floor", m.floor_pct, 1.0);
  visit("Ceiling", m.ceiling_pct, 1.0);
  visit("Diameter", m.diameter_m, 1000.0);
}

inline void each_signal(hal::can::Phases& m, auto&& visit) {
  visit("Count", m.count, 1.0);
  visit("VoltageU", m.voltage_ratio[0], 1.0);
  visit("VoltageV", m.voltage_ratio[1], 1.0);
  visit("CurrentU", m.current_ratio[0], 1.0);
  visit("CurrentV", m.current_ratio[1], 1.0);
}

inline void each_signal(hal::can::Spindle& m, auto&& visit) {
  visit("Count", m.count, 1.0);
  visit("Speed", m.speed_rad_s, 1.0);
  visit("PowerMeter", m.power_meter_w, 1.0);
  visit("Overruns", m.overruns, 1.0);
  visit("Overload", m.overload, 1.0);
}

// visit(name, message) once for each kind of message, with a message of that kind.
inline void each_message(auto&& visit) {
  visit("Override", hal::can::Override{});
  visit("Estimate", hal::can::Estimate{});
  visit("Diagnostics", hal::can::Diagnostics{});
  visit("Emergency", hal::can::Emergency{});
  visit("Heartbeat", hal::can::Heartbeat{});
  visit("MachineState", hal::can::MachineState{});
  visit("Job", hal::can::Job{});
  visit("Phases", hal::can::Phases{});
  visit("Spindle", hal::can::Spindle{});
}

// pack() of guarded and other messages alike.
template <class Message>
[[nodiscard]] hal::can::Frame packed(const Message& message, std::uint8_t node,
                                     std::uint8_t counter) {
  if constexpr (requires { hal::can::pack(message, node, counter); }) {
    return hal::can::pack(message, node, counter);
  } else {
    return hal::can::pack(message, node);
  }
}

}  // namespace cutforce::host_tests
