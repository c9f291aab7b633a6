// What the blocks' configs share, derived once from the machine's parameters.
#pragma once

#include <cstdint>
#include <expected>

#include "estimator/front_end.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware {

enum class ConfigurationError : std::uint8_t {
  kSampleRate,  // not known: neither the machine nor the recording says it
  kPolePairs,
  kRating,          // rated power or torque missing
  kEstimatePeriod,  // not a whole number of sample periods
  kControlPeriod,   // not a whole number of estimate periods
  kBlock,           // a block refuses; see block
};

namespace from_machine {

inline constexpr float kTwoPi = 6.2831853F;
inline constexpr float kUsualFluxRatio = 0.9F;  // rotor flux over the flux of the rated voltage

// Uncertainties that no parameter speaks of; relative to the rated torque unless said.
inline constexpr float kIdleTorqueSigma = 0.03F;
inline constexpr float kRotorResistanceSigma_ratio = 0.3F;
inline constexpr float kIronTorqueSigma = 0.015F;  // of an induction motor that nobody measured
inline constexpr float kDeclaredIronTorqueSigma = 0.003F;
inline constexpr float kSensorGainSigma_ratio = 0.01F;
inline constexpr float kMeterSigma_ratio = 0.003F;
inline constexpr float kMeterImplausible_ratio = 0.05F;
inline constexpr float kLeastInertiaSigma_ratio = 0.15F;  // a name plate's; the run-up knows better
inline constexpr float kLeastResistanceSigma_ratio =
    0.25F;  // temperature alone moves copper by that

// The part of the machine that the blocks share, derived once.
struct Derived {
  float sample_period_s;
  float resistance_ohm;  // star-equivalent
  float rated_frequency_rad_s;
  float flux_v_s;
  float inertia_sigma_ratio;
  float resistance_sigma_ratio;
  std::uint32_t samples_per_estimate;
  std::uint32_t estimates_per_control;
};

// Nearest whole number, if `ratio` is near one that is at least 1; else 0.
[[nodiscard]] constexpr std::uint32_t whole(float ratio) noexcept {
  if (!(ratio > 0.5F && ratio < 1e6F)) return 0;
  const auto nearest = static_cast<std::uint32_t>(ratio + 0.5F);
  const float off = ratio - static_cast<float>(nearest);
  return off < 1e-3F * ratio && off > -1e-3F * ratio ? nearest : 0;
}

[[nodiscard]] constexpr std::expected<Derived, ConfigurationError> derive(
    const Machine& m) noexcept {
  if (!(m.sample_rate_hz > 0.0F)) return std::unexpected{ConfigurationError::kSampleRate};
  if (!(m.pole_pairs >= 1.0F)) return std::unexpected{ConfigurationError::kPolePairs};
  if (!(m.rated_power_w > 0.0F && m.rated_torque_nm > 0.0F && m.rated_frequency_hz > 0.0F &&
        m.rated_voltage_v_rms > 0.0F))
    return std::unexpected{ConfigurationError::kRating};
  Derived d{};
  d.sample_period_s = 1.0F / m.sample_rate_hz;
  d.samples_per_estimate = whole(estimate_period_s(m) * m.sample_rate_hz);
  if (d.samples_per_estimate == 0) return std::unexpected{ConfigurationError::kEstimatePeriod};
  d.estimates_per_control = whole(m.control_period_s / estimate_period_s(m));
  if (d.estimates_per_control == 0) return std::unexpected{ConfigurationError::kControlPeriod};
  d.resistance_ohm = m.winding == Winding::kDelta
                         ? estimator::star_equivalent_resistance(m.stator_resistance_ohm)
                         : m.stator_resistance_ohm;
  d.rated_frequency_rad_s = kTwoPi * m.rated_frequency_hz;
  d.flux_v_s = kUsualFluxRatio * 0.8164966F * m.rated_voltage_v_rms / d.rated_frequency_rad_s;
  d.inertia_sigma_ratio = m.inertia_sigma_ratio > kLeastInertiaSigma_ratio
                              ? m.inertia_sigma_ratio
                              : kLeastInertiaSigma_ratio;
  d.resistance_sigma_ratio = m.stator_resistance_sigma_ratio > kLeastResistanceSigma_ratio
                                 ? m.stator_resistance_sigma_ratio
                                 : kLeastResistanceSigma_ratio;
  return d;
}

// With a dynamometer the motor's blocks stand still. They are made for a rate that suits them, not
// for the dynamometer's, which may be one sample a control period.
[[nodiscard]] constexpr Derived for_motor(const Machine& m, Derived d) noexcept {
  if (m.estimator != EstimatorName::kDynamometer) return d;
  d.sample_period_s = 1e-3F;
  d.samples_per_estimate = 1;
  d.estimates_per_control = 50;
  return d;
}

}  // namespace from_machine
}  // namespace cutforce::firmware
