// What the frames on the bus say, in SI units, percent and plain numbers. The layout is that of
// cutforce.dbc, which is the contract; a test holds this file to it by an independent reader.
//
//   sent      Override 0x180+N, Estimate 0x280+N, Diagnostics 0x380+N, Emergency 0x080+N,
//             Heartbeat 0x700+N
//   received  MachineState 0x200+N, Job 0x300+N from the CNC;
//             Phases 0x100+N, Spindle 0x400+N from an acquisition node
//
// N is the node id, 1..127. Override, MachineState and Job are guarded (guard.hpp). A value that is
// not known has its own code on the wire and an empty optional here. pack() saturates, rounds to
// the nearest step, and never sends the code for "not known" for a value that is.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <optional>
#include <type_traits>

#include "hal/can/frame.hpp"

namespace cutforce::hal::can {

enum class Base : std::uint32_t {
  kEmergency = 0x080,
  kPhases = 0x100,
  kOverride = 0x180,
  kMachineState = 0x200,
  kEstimate = 0x280,
  kJob = 0x300,
  kDiagnostics = 0x380,
  kSpindle = 0x400,
  kHeartbeat = 0x700,
};
[[nodiscard]] constexpr std::uint32_t identifier(Base base, std::uint8_t node) noexcept {
  return static_cast<std::uint32_t>(base) + node;
}

// Why a received frame was not taken. The guard's own reasons are GuardError's (guard.hpp).
enum class FrameError : std::uint8_t {
  kFormat,  // extended, remote, or not of the length that the DBC says
  kRange,   // a value that the DBC does not allow
};

struct Override {
  std::optional<std::uint8_t> override_pct;  // 0..254
  std::uint8_t state;                        // control::SupervisorState, 0..15
  std::uint8_t reason;                       // control::Reason, 0..15: the group of the cause
  std::optional<float> force_n;              // steps of 0.5 N
  bool enabled;  // to be followed: in control, and after a fault until it is acknowledged
  bool saturated_low;
  bool saturated_high;
  bool in_cut;
  std::uint8_t source;  // firmware::Source, 0..7
  bool limit;           // the force is beyond its hard limit
};

struct Estimate {
  std::optional<float> force_n;
  std::optional<float> force_sigma_n;  // steps of 0.5 N, to 2047 N
  float reference_n;
  std::optional<float> power_w;                 // into the air gap; steps of 10 W, signed
  std::optional<float> stability_margin_ratio;  // steps of 0.05
};

struct Diagnostics {
  std::optional<float> process_gain_n_pct;  // steps of 0.01
  std::optional<float> wear_ratio;          // process gain over its first value; steps of 0.02
  std::uint32_t worst_loop_us;
  std::uint32_t refused_frames;  // counters; the wire has their low 8 bits
  std::uint32_t unsent_frames;
  std::uint32_t lost_samples;
};

struct Emergency {
  std::uint16_t error_code;     // CiA 301 table; 0: no error any more
  std::uint8_t error_register;  // CiA 301 object 1001h
  std::uint8_t state;           // control::SupervisorState
  std::uint8_t reason;          // control::Reason
  std::uint16_t detail;         // of the reason
};

struct Heartbeat {
  std::uint8_t nmt_state;  // CiA 301: 0 boot-up, 4 stopped, 5 operational, 127 pre-operational
};

struct MachineState {
  bool arm;      // a rising edge arms
  bool control;  // a rising edge gives control to the board, a fall takes it back
  bool reset;    // a rising edge acknowledges what is latched
  bool spindle_at_speed;
  bool cutting_feed;  // false at rest, in rapid moves and in the air
  bool rapid;
  bool threading;   // or tapping, or any feed bound to the spindle
  bool part_start;  // a rising edge: the program of a part, or a repeated block, starts
  std::uint8_t tool;
  std::optional<std::uint8_t> override_applied_pct;  // 0..254
  std::optional<float> feed_m_s;                     // programmed; steps of 1 mm/min
};

// What is not given stays as the machine file has it.
struct Job {
  std::optional<float> force_reference_n;   // steps of 4 N, to 16380 N
  std::optional<float> force_limit_ratio;   // of the reference: 1.01..3.55
  std::optional<std::uint8_t> floor_pct;    // steps of 10, 0..140
  std::optional<std::uint8_t> ceiling_pct;  // steps of 10, 0..250
  std::optional<float> diameter_m;          // of workpiece or tool; steps of 0.5 mm, to 1.0235 m
};

// One sample of the acquisition node: two voltages, two line currents, and an 8-bit count of
// samples. Full scale is the machine file's; the third of each is minus the sum of the two.
struct Phases {
  std::uint8_t count;
  std::array<std::optional<float>, 2> voltage_ratio;  // of full scale, -1..1; 14 bits
  std::array<std::optional<float>, 2> current_ratio;
};

struct Spindle {
  std::uint8_t count;                  // of the sample that these values belong to
  std::optional<float> speed_rad_s;    // steps of 0.005 rad/s, to 2621 rad/s either way
  std::optional<float> power_meter_w;  // steps of 4 W, signed
  std::uint8_t overruns;               // samples that the node itself lost, a counter
  bool overload;                       // an input was beyond its range since the last frame
};

// Frames without a guard. The guarded ones need a counter: guard.hpp seals and opens them.
[[nodiscard]] Frame pack(const Estimate& message, std::uint8_t node) noexcept;
[[nodiscard]] Frame pack(const Diagnostics& message, std::uint8_t node) noexcept;
[[nodiscard]] Frame pack(const Emergency& message, std::uint8_t node) noexcept;
[[nodiscard]] Frame pack(const Heartbeat& message, std::uint8_t node) noexcept;
[[nodiscard]] Frame pack(const Phases& message, std::uint8_t node) noexcept;
[[nodiscard]] Frame pack(const Spindle& message, std::uint8_t node) noexcept;
[[nodiscard]] Frame pack(const Override& message, std::uint8_t node, std::uint8_t counter) noexcept;
[[nodiscard]] Frame pack(const MachineState& message, std::uint8_t node,
                         std::uint8_t counter) noexcept;
[[nodiscard]] Frame pack(const Job& message, std::uint8_t node, std::uint8_t counter) noexcept;

// From a frame whose identifier is the message's. Guarded frames: after the guard let them pass.
// Bits that the DBC leaves spare are not looked at (layout.hpp says why).
template <class Message>
[[nodiscard]] std::expected<Message, FrameError> unpack(const Frame& frame) noexcept;

template <>
std::expected<Override, FrameError> unpack(const Frame& frame) noexcept;
template <>
std::expected<Estimate, FrameError> unpack(const Frame& frame) noexcept;
template <>
std::expected<Diagnostics, FrameError> unpack(const Frame& frame) noexcept;
template <>
std::expected<Emergency, FrameError> unpack(const Frame& frame) noexcept;
template <>
std::expected<Heartbeat, FrameError> unpack(const Frame& frame) noexcept;
template <>
std::expected<MachineState, FrameError> unpack(const Frame& frame) noexcept;
template <>
std::expected<Job, FrameError> unpack(const Frame& frame) noexcept;
template <>
std::expected<Phases, FrameError> unpack(const Frame& frame) noexcept;
template <>
std::expected<Spindle, FrameError> unpack(const Frame& frame) noexcept;

}  // namespace cutforce::hal::can
