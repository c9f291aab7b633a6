// What the name plate says of the motor, for values that nobody gave: (F1) to (F8) of EQUATIONS.md.
// Each is an engineering guess with a stated spread, good enough to start with and never silent:
// machine_file.hpp warns of each, and the relative uncertainties are widened to match.
//
// SI units; arithmetic alone (no libm), so an image compiled for a target holds the same bits.
#pragma once

#include <cstdint>
#include <expected>
#include <string_view>

#include "firmware/machine.hpp"

namespace cutforce::firmware {

enum class RatingError : std::uint8_t {
  kPolePairs,  // pole_pairs is not positive
  kNoRating,   // neither rated power nor rated torque: nothing to start from
};

// Twice the standard deviation of a derived value, as a part of it; 0: not a derived value.
[[nodiscard]] constexpr float derived_spread_ratio(std::string_view key) noexcept {
  if (key == "stator_resistance_ohm") return 0.5F;
  if (key == "rotor_resistance_ohm") return 0.4F;
  if (key == "leakage_inductance_h") return 0.6F;
  if (key == "inertia_kg_m2") return 0.6F;
  if (key == "rated_voltage_v_rms" || key == "rated_current_a_rms") return 0.15F;
  if (key.starts_with("rated_")) return 0.05F;
  return 0.0F;
}

namespace detail {

inline constexpr float kTwoPi = 6.2831853F;
inline constexpr float kSqrt3 = 1.7320508F;
inline constexpr float kUsualSlip = 0.04F;
inline constexpr float kUsualEfficiencyTimesPowerFactor = 0.66F;  // (F3)
inline constexpr float kUsualVoltageV = 400.0F;                   // (F3)
inline constexpr float kUsualFluxRatio = 0.9F;                    // (F7)
inline constexpr float kUsualLeakageRatio = 0.17F;                // (F6)
inline constexpr float kLargestResistanceRatio = 0.2F;            // (F5)
inline constexpr float kUsualRunUpS = 0.4F;                       // (F8)

// Newton's iteration; x within 1e-6..1e6 converges to the last bit or one beside it.
[[nodiscard]] constexpr float square_root(float x) noexcept {
  float y = x > 1.0F ? x : 1.0F;
  for (int k = 0; k < 40; ++k) y = 0.5F * (y + x / y);
  return y;
}

// (F2) Which mains frequency gives a slip that a motor can have.
[[nodiscard]] constexpr float frequency_from_speed(float speed_rad_s, float pole_pairs) noexcept {
  const float rotor_hz = speed_rad_s * pole_pairs / kTwoPi;
  for (const float mains_hz : {50.0F, 60.0F}) {
    const float slip = 1.0F - rotor_hz / mains_hz;
    if (slip > -0.002F && slip < 0.08F) return mains_hz;
  }
  return rotor_hz / (1.0F - kUsualSlip);
}

// (F1) Two of power, torque and speed give the third; one alone needs the frequency.
constexpr void derive_power_torque_speed(Machine& m) noexcept {
  const bool power = m.rated_power_w > 0.0F;
  const bool torque = m.rated_torque_nm > 0.0F;
  if (!(m.rated_speed_rad_s > 0.0F)) {
    const float mains_hz = m.rated_frequency_hz > 0.0F ? m.rated_frequency_hz : 50.0F;
    m.rated_speed_rad_s = power && torque ? m.rated_power_w / m.rated_torque_nm
                                          : kTwoPi * mains_hz / m.pole_pairs * (1.0F - kUsualSlip);
  }
  if (!torque) m.rated_torque_nm = m.rated_power_w / m.rated_speed_rad_s;
  if (!power) m.rated_power_w = m.rated_torque_nm * m.rated_speed_rad_s;
}

// (F3) The name plate's power factor and efficiency tie voltage and current.
constexpr void derive_voltage_current(Machine& m) noexcept {
  const float apparent_va = m.rated_power_w / kUsualEfficiencyTimesPowerFactor;
  if (!(m.rated_voltage_v_rms > 0.0F)) {
    m.rated_voltage_v_rms = m.rated_current_a_rms > 0.0F
                                ? apparent_va / (kSqrt3 * m.rated_current_a_rms)
                                : kUsualVoltageV;
  }
  if (!(m.rated_current_a_rms > 0.0F)) {
    m.rated_current_a_rms = apparent_va / (kSqrt3 * m.rated_voltage_v_rms);
  }
}

constexpr void derive_impedances(Machine& m) noexcept {
  const float base_ohm = m.rated_voltage_v_rms / (kSqrt3 * m.rated_current_a_rms);
  const float stator_rad_s = kTwoPi * m.rated_frequency_hz;
  if (!(m.stator_resistance_ohm > 0.0F)) {  // (F5)
    const float ratio = 0.117F * square_root(1000.0F / m.rated_power_w);
    const float star_ohm =
        (ratio < kLargestResistanceRatio ? ratio : kLargestResistanceRatio) * base_ohm;
    m.stator_resistance_ohm = m.winding == Winding::kDelta ? 3.0F * star_ohm : star_ohm;
  }
  if (!(m.leakage_inductance_h > 0.0F)) {  // (F6)
    m.leakage_inductance_h = kUsualLeakageRatio * base_ohm / stator_rad_s;
  }
  if (!(m.rotor_resistance_ohm > 0.0F)) {  // (F4), (F7)
    float slip_rad_s = stator_rad_s - m.pole_pairs * m.rated_speed_rad_s;
    // A name plate that names the synchronous speed says nothing of the slip.
    if (!(slip_rad_s > 0.005F * stator_rad_s)) slip_rad_s = kUsualSlip * stator_rad_s;
    const float flux_vs = kUsualFluxRatio * 0.8164966F * m.rated_voltage_v_rms / stator_rad_s;
    m.rotor_resistance_ohm =
        1.5F * m.pole_pairs * flux_vs * flux_vs * slip_rad_s / m.rated_torque_nm;
  }
}

}  // namespace detail

// Fills every value that is 0 and can be derived; what is given stays as it is.
// Fails iff pole_pairs is not positive, or neither rated power nor rated torque is given.
[[nodiscard]] constexpr std::expected<Machine, RatingError> complete_from_rating(
    Machine machine) noexcept {
  if (!(machine.pole_pairs > 0.0F)) return std::unexpected{RatingError::kPolePairs};
  if (!(machine.rated_power_w > 0.0F) && !(machine.rated_torque_nm > 0.0F)) {
    return std::unexpected{RatingError::kNoRating};
  }
  detail::derive_power_torque_speed(machine);
  if (!(machine.rated_frequency_hz > 0.0F)) {
    machine.rated_frequency_hz =
        detail::frequency_from_speed(machine.rated_speed_rad_s, machine.pole_pairs);
  }
  detail::derive_voltage_current(machine);
  const bool resistance_given = machine.stator_resistance_ohm > 0.0F;
  detail::derive_impedances(machine);
  const auto widen = [](float& sigma_ratio, std::string_view key) {
    const float derived = 0.5F * derived_spread_ratio(key);
    if (sigma_ratio < derived) sigma_ratio = derived;
  };
  if (!resistance_given) widen(machine.stator_resistance_sigma_ratio, "stator_resistance_ohm");
  if (!(machine.inertia_kg_m2 > 0.0F)) {  // (F8)
    machine.inertia_kg_m2 =
        machine.rated_torque_nm * detail::kUsualRunUpS / machine.rated_speed_rad_s;
    widen(machine.inertia_sigma_ratio, "inertia_kg_m2");
  }
  return machine;
}

}  // namespace cutforce::firmware
