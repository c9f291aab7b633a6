// What can be wrong with the signals, as a set of bits. Every fault has one name, the same in
// trace, summary and documentation.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace cutforce::estimator {

enum class Fault : std::uint8_t {
  kNonFinite,     // NaN or infinity in a signal
  kOutOfRange,    // beyond the sensor's range
  kTimeOrder,     // a time stamp repeated or went backwards
  kGap,           // samples are missing
  kStuckChannel,  // a channel does not move although the machine turns
  kLostPhase,     // a phase carries no current, or a voltage channel no voltage
  kPhaseOrder,    // voltages and currents turn in opposite senses, or a channel has the wrong sign
  kRawPwm,        // voltages were sampled without an anti-alias filter: no torque can be had
  kClipped,       // a channel sits at the end of its range
};
inline constexpr std::size_t kFaultCount = 9;

inline constexpr std::array<std::string_view, kFaultCount> kFaultNames{
    "non_finite", "out_of_range", "time_order", "gap",    "stuck_channel",
    "lost_phase", "phase_order",  "raw_pwm",    "clipped"};

struct FaultSet {
  std::uint32_t bits = 0;

  constexpr void insert(Fault fault) noexcept {
    bits |= std::uint32_t{1} << static_cast<unsigned>(fault);
  }
  [[nodiscard]] constexpr bool contains(Fault fault) const noexcept {
    return (bits >> static_cast<unsigned>(fault) & 1U) != 0;
  }
  [[nodiscard]] constexpr bool empty() const noexcept { return bits == 0; }
  friend constexpr FaultSet operator|(FaultSet a, FaultSet b) noexcept { return {a.bits | b.bits}; }
  friend constexpr bool operator==(FaultSet, FaultSet) noexcept = default;
};

}  // namespace cutforce::estimator
