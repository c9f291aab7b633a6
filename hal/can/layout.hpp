// Where each value of each message is: the text of cutforce.dbc once more, for the compiler. One
// list serves both directions. host_tests/can/check_dbc.py holds it to the DBC file by a reader
// that knows nothing of it.
//
// Spare bits (Emergency: byte 7; Spindle: bits 53 to 63) are sent as 0 and not looked at on
// receipt, so that a later sender may use them without an older receiver falling silent. A change
// of what is there today takes another identifier.
#pragma once

#include <cstdint>

#include "hal/can/fields.hpp"
#include "hal/can/messages.hpp"

namespace cutforce::hal::can {

// kBase, kLength, kGuarded, and visit(v, m), which calls v(field, member) for each value.
template <class Message>
struct Layout;

template <Base kId, std::uint8_t kBytes, bool kHasGuard>
struct FrameShape {
  static constexpr Base kBase = kId;
  static constexpr std::uint8_t kLength = kBytes;
  static constexpr bool kGuarded = kHasGuard;
};

template <>
struct Layout<Override> : FrameShape<Base::kOverride, 8, true> {
  static constexpr void visit(auto& v, auto& m) noexcept {
    v(unsigned_field(24, 8).without(255), m.override_pct);
    v(unsigned_field(32, 4), m.state);
    v(unsigned_field(36, 4), m.reason);
    v(unsigned_field(40, 16).without(65535).scaled(1, 2), m.force_n);
    v(flag(56), m.enabled);
    v(flag(57), m.saturated_low);
    v(flag(58), m.saturated_high);
    v(flag(59), m.in_cut);
    v(unsigned_field(60, 3), m.source);
    v(flag(63), m.limit);
  }
};

template <>
struct Layout<Estimate> : FrameShape<Base::kEstimate, 8, false> {
  static constexpr void visit(auto& v, auto& m) noexcept {
    v(unsigned_field(0, 16).without(65535).scaled(1, 2), m.force_n);
    v(unsigned_field(16, 12).without(4095).scaled(1, 2), m.force_sigma_n);
    v(unsigned_field(28, 16).scaled(1, 2), m.reference_n);
    v(signed_field(44, 12).without(-2048).scaled(10, 1), m.power_w);
    v(unsigned_field(56, 8).without(255).scaled(1, 20), m.stability_margin_ratio);
  }
};

template <>
struct Layout<Diagnostics> : FrameShape<Base::kDiagnostics, 8, false> {
  static constexpr void visit(auto& v, auto& m) noexcept {
    v(unsigned_field(0, 16).without(65535).scaled(1, 100), m.process_gain_n_pct);
    v(unsigned_field(16, 8).without(255).scaled(1, 50), m.wear_ratio);
    v(unsigned_field(24, 16), m.worst_loop_us);
    v(unsigned_field(40, 8).wrapping(), m.refused_frames);
    v(unsigned_field(48, 8).wrapping(), m.unsent_frames);
    v(unsigned_field(56, 8).wrapping(), m.lost_samples);
  }
};

template <>
struct Layout<Emergency> : FrameShape<Base::kEmergency, 8, false> {
  static constexpr void visit(auto& v, auto& m) noexcept {
    v(unsigned_field(0, 16), m.error_code);
    v(unsigned_field(16, 8), m.error_register);
    v(unsigned_field(24, 8).up_to(15), m.state);
    v(unsigned_field(32, 8).up_to(15), m.reason);
    v(unsigned_field(40, 16), m.detail);
  }
};

template <>
struct Layout<Heartbeat> : FrameShape<Base::kHeartbeat, 1, false> {
  static constexpr void visit(auto& v, auto& m) noexcept {
    v(unsigned_field(0, 8).up_to(127), m.nmt_state);
  }
};

template <>
struct Layout<MachineState> : FrameShape<Base::kMachineState, 8, true> {
  static constexpr void visit(auto& v, auto& m) noexcept {
    v(flag(24), m.arm);
    v(flag(25), m.control);
    v(flag(26), m.reset);
    v(flag(27), m.spindle_at_speed);
    v(flag(28), m.cutting_feed);
    v(flag(29), m.rapid);
    v(flag(30), m.threading);
    v(flag(31), m.part_start);
    v(unsigned_field(32, 8), m.tool);
    v(unsigned_field(40, 8).without(255), m.override_applied_pct);
    v(unsigned_field(48, 16).without(65535).scaled(1, 60000), m.feed_m_s);
  }
};

template <>
struct Layout<Job> : FrameShape<Base::kJob, 8, true> {
  static constexpr void visit(auto& v, auto& m) noexcept {
    v(unsigned_field(24, 12).without(0).scaled(4, 1), m.force_reference_n);
    v(unsigned_field(36, 8).without(0).scaled(1, 100, 100), m.force_limit_ratio);
    v(unsigned_field(44, 4).without(15).scaled(10, 1), m.floor_pct);
    v(unsigned_field(48, 5).without(31).up_to(25).scaled(10, 1), m.ceiling_pct);
    v(unsigned_field(53, 11).without(0).scaled(1, 2000), m.diameter_m);
  }
};

template <>
struct Layout<Phases> : FrameShape<Base::kPhases, 8, false> {
  static constexpr void visit(auto& v, auto& m) noexcept {
    const auto ratio = [](unsigned first) {
      return signed_field(first, 14).without(-8192).scaled(1, 8191);
    };
    v(unsigned_field(0, 8), m.count);
    v(ratio(8), m.voltage_ratio[0]);
    v(ratio(22), m.voltage_ratio[1]);
    v(ratio(36), m.current_ratio[0]);
    v(ratio(50), m.current_ratio[1]);
  }
};

template <>
struct Layout<Spindle> : FrameShape<Base::kSpindle, 8, false> {
  static constexpr void visit(auto& v, auto& m) noexcept {
    v(unsigned_field(0, 8), m.count);
    v(signed_field(8, 20).without(-524288).scaled(1, 200), m.speed_rad_s);
    v(signed_field(28, 16).without(-32768).scaled(4, 1), m.power_meter_w);
    v(unsigned_field(44, 8), m.overruns);
    v(flag(52), m.overload);
  }
};

}  // namespace cutforce::hal::can
