// What a simulation or a drive knows beyond the signals: for scoring and reports, never for an
// estimate. A type of its own, so that nothing that reads samples can come by it.
#pragma once

#include <cstdint>
#include <type_traits>

namespace cutforce::hal::host {

enum class TruthSignal : std::uint8_t {
  kAirGapTorque,
  kLoadTorque,
  kCuttingTorque,
  kCuttingForce,
  kDriveAirGapTorque,
};

[[nodiscard]] constexpr std::uint32_t bit(TruthSignal signal) noexcept {
  return std::uint32_t{1} << static_cast<unsigned>(signal);
}

// Beside the Sample of the same row. What is not present has value 0.
struct Truth {
  float airgap_torque_nm;
  float load_torque_nm;
  float cutting_torque_nm;  // at the motor
  float cutting_force_n;
  float drive_airgap_torque_nm;  // the drive's own estimate; not a truth
  std::uint32_t present;         // bit(TruthSignal) of each value that is there

  [[nodiscard]] constexpr bool has(TruthSignal signal) const noexcept {
    return (present & bit(signal)) != 0;
  }
};
static_assert(std::is_trivially_copyable_v<Truth> && std::is_standard_layout_v<Truth>);

}  // namespace cutforce::hal::host
