// The contract between the control loop and the world.
// A port delivers raw samples in SI units and takes commands. It is a concept, not a base class:
// a missing operation is a compile error that names it, and the loop inlines.
//
// Conversion to SI happens once, behind this line. Time is the sampling time that the port
// measured, never a clock read by the loop.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <type_traits>

namespace cutforce::hal {

// What a sample may carry. A bit of Sample::present says that the value is there; what is not
// there has value 0 and is never read.
enum class Signal : std::uint8_t {
  kVoltageU,  // phase-to-neutral u, or line-to-line uv
  kVoltageV,  // phase-to-neutral v, or line-to-line vw
  kVoltageW,  // phase-to-neutral w, or line-to-line wu
  kCurrentU,
  kCurrentV,
  kCurrentW,
  kSpeed,
  kPowerMeter,
  kMeasuredForce,
  kFeedActive,
  kOverrideApplied,
  kWorkpieceDiameter,
  kFeedRate,
  kEnable,
  kPartStart,
};
inline constexpr unsigned kSignalCount = 15;

[[nodiscard]] constexpr std::uint32_t bit(Signal signal) noexcept {
  return std::uint32_t{1} << static_cast<unsigned>(signal);
}

// One row of raw signals. Shapes: [3] in the order of Signal.
struct Sample {
  std::int64_t time_ns;  // of sampling, any origin
  std::array<float, 3> voltage_v;
  std::array<float, 3> current_a;  // line currents u, v, w
  float speed_rad_s;               // motor shaft, mechanical
  float power_meter_w;             // the drive's own slow power output
  float measured_force_n;          // dynamometer; only the estimator `dynamometer` reads it
  float feed_active;               // 1 while the CNC feeds in a cutting move, else 0
  float override_applied_pct;      // as the CNC reports it
  float workpiece_diameter_m;      // may change while cutting
  float feed_m_s;                  // as the CNC reports it
  float enable;                    // 1: control allowed
  float part_start;                // 1 where the program of a part, or a repeated block, starts
  std::uint32_t present;           // bit(Signal) of each value that is there

  [[nodiscard]] constexpr bool has(Signal signal) const noexcept {
    return (present & bit(signal)) != 0;
  }
};
static_assert(std::is_trivially_copyable_v<Sample>);

// What the loop sends, once a control tick.
struct Command {
  std::int64_t time_ns;        // of the last sample that it rests on
  std::uint8_t override_pct;   // 0..254, after limits, slew and rounding
  std::uint8_t override_code;  // the byte on the port, in the configured code
  bool controlling;            // false: monitor only, override_pct is the neutral value
};

enum class PortError : std::uint8_t {
  kMalformed,  // data that cannot be understood; the port kept where and why
  kLinkLost,   // the other side went away
  kSystem,     // the operating system refused
};

// read() fills the front of `block` and returns how many samples it filled, at least one; it may
// return fewer than fit, so that no sample waits for a later one. 0 means the data has ended.
template <class P>
concept Port = requires(P& port, std::span<Sample> block, const Command& command) {
  { port.read(block) } -> std::same_as<std::expected<std::size_t, PortError>>;
  { port.write(command) } -> std::same_as<std::expected<void, PortError>>;
};

}  // namespace cutforce::hal
