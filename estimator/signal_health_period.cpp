// The rules of SignalHealth that look at whole electrical periods.
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "estimator/signal_health.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kCoherent = 0.5F;           // share of |i|^2 that must turn at the frequency
constexpr float kLostShare = 0.25F;         // (E14)
constexpr float kMinorShare = 1.0F / 3.0F;  // (E15)
constexpr float kOrderPatience_s = 0.3F;
// A real drive's recording shows its speed 0.9 s behind its voltages after a step: what rests on
// the frequency's value and not only on its sense waits for longer than that.
constexpr float kPowerPatience_s = 1.0F;
constexpr float kSteady = 0.03F;  // change of the frequency within which it counts as steady
constexpr float kFluxPatience_s = 1.5F;
constexpr float kVanishedPatience_s = 0.15F;
constexpr float kFluxFrom = 0.15F;  // of rated frequency
constexpr float kFluxLeast = 0.3F;  // of rated flux
constexpr float kVanished = 0.05F;  // of the voltage that rated flux induces
constexpr float kFluxMost = 1.5F;

float size(SpaceVector x) noexcept { return std::sqrt(dot(x, x)); }

constexpr SpaceVector conjugate(SpaceVector x) noexcept { return {x.alpha, -x.beta}; }

// The larger sequence, seen in the frame that turns with it, and the smaller one.
struct Senses {
  SpaceVector major;
  float minor;
  bool with_frequency;
};

Senses senses(const PeriodPhasors::Sequences& x) noexcept {
  if (dot(x.positive, x.positive) >= dot(x.negative, x.negative))
    return {x.positive, size(x.negative), true};
  return {conjugate(x.negative), size(x.positive), false};
}

}  // namespace

void SignalHealth::judge_rotation(const Tick& tick) noexcept {
  if (!(tick.period_s > 0.0F)) {
    state_.phasors = {};
    state_.raw = {};
    state_.amplitude = {};
    state_.window_s = state_.vanished_s = 0.0F;
    forget_streaks();
    return;
  }
  if (state_.raw.step({.motor = tick.sample.motor,
                       .angle_rad = tick.sample.angle_rad,
                       .elapsed_s = tick.elapsed_s}))
    state_.raw_latched = 1;
  state_.window_s += tick.elapsed_s;
  if (state_.phasors.step(tick.sample)) {
    judge_period(tick, state_.phasors.result());
    state_.phasors.begin();
    state_.window_s = 0.0F;
  }
}

void SignalHealth::forget_streaks() noexcept {
  state_.order_s = state_.reverse_s = state_.flux_s = 0.0F;
}

void SignalHealth::judge_period(const Tick& tick, const PeriodPhasors::Result& result) noexcept {
  if (!(result.coherence >= kCoherent)) {
    state_.vanished_s = 0.0F;
    forget_streaks();
    return;
  }
  state_.amplitude = result.amplitude;
  state_.mean = result.mean;
  const std::uint32_t lost_now = lost(result);
  if (lost_now != 0) {
    raise(Fault::kLostPhase);
    state_.seen.lost_channels |= lost_now;
  }
  // What a missing channel does to the sequences and to the flux is no news.
  if (state_.held.contains(Fault::kLostPhase) || state_.held.contains(Fault::kStuckChannel)) {
    forget_streaks();
    return;
  }
  judge_vanished(tick, result);
  // Power flows back, and rotor and stator part company, only while the speed changes.
  const float frequency = tick.frequency_rad_s;
  if (!(std::fabs(frequency - state_.steady_frequency_rad_s) <= kSteady * std::fabs(frequency))) {
    state_.steady_frequency_rad_s = frequency;
    forget_streaks();
    return;
  }
  judge_order(frequency, result);
  judge_flux(tick, result);
}

std::uint32_t SignalHealth::lost(const PeriodPhasors::Result& result) const noexcept {  // (E14)
  std::uint32_t channels = 0;
  for (std::size_t kind = 0; kind < 2; ++kind) {
    const std::size_t first = 3 * kind;
    const std::size_t end = first + measured(kind);
    float largest = 0.0F;
    for (std::size_t k = first; k < end; ++k) largest = std::max(largest, result.amplitude[k]);
    if (!(largest >= (kind == 0 ? config_.voltage_floor_v : config_.current_floor_a))) continue;
    for (std::size_t k = first; k < end; ++k) {
      if (result.amplitude[k] < kLostShare * largest &&
          std::fabs(result.mean[k]) < kLostShare * largest)
        channels |= 1U << k;
    }
  }
  return channels;
}

void SignalHealth::judge_order(float frequency_rad_s,
                               const PeriodPhasors::Result& result) noexcept {
  const Senses v = senses(result.voltage_v);
  const Senses i = senses(result.current_a);
  const float v_size = size(v.major);
  const float i_size = size(i.major);
  if (state_.raw_latched != 0 || !(v_size >= config_.voltage_floor_v) ||
      !(i_size >= config_.current_floor_a)) {
    state_.order_s = state_.reverse_s = 0.0F;
    return;
  }
  // (E15); whichever way it turns, the machine takes reactive power however it is loaded.
  const float reactive =
      frequency_rad_s < 0.0F ? -cross(v.major, i.major) : cross(v.major, i.major);
  const float apparent = v_size * i_size;
  const bool wrong = v.with_frequency != i.with_frequency || v.minor > kMinorShare * v_size ||
                     i.minor > kMinorShare * i_size ||
                     result.residual_a > 3.0F * kMinorShare * i_size;
  state_.order_s = wrong ? state_.order_s + state_.window_s : 0.0F;
  // Two windows at least: one that holds a step of the load is no sine.
  if (state_.order_s >= std::max(kOrderPatience_s, 1.9F * state_.window_s))
    raise(Fault::kPhaseOrder);

  const bool reverse = dot(v.major, i.major) < -0.2F * apparent || reactive < -0.1F * apparent;
  state_.reverse_s = reverse ? state_.reverse_s + state_.window_s : 0.0F;
  if (state_.reverse_s >= kPowerPatience_s) raise(Fault::kPhaseOrder);
}

// Sampled in step with the carrier at its zero vectors a voltage is simply not there, although the
// current turns.
void SignalHealth::judge_vanished(const Tick& tick, const PeriodPhasors::Result& result) noexcept {
  const float rated_rad_s = config_.rated_frequency_rad_s;
  const float frequency = std::fabs(tick.frequency_rad_s);
  const bool vanished = frequency >= kFluxFrom * rated_rad_s &&
                        size(senses(result.current_a).major) >= config_.current_floor_a &&
                        size(senses(result.voltage_v).major) <
                            kVanished * config_.rated_flux_v_s * std::min(frequency, rated_rad_s);
  state_.vanished_s = vanished ? state_.vanished_s + state_.window_s : 0.0F;
  if (state_.vanished_s >= kVanishedPatience_s) state_.raw_latched = 1;
}

void SignalHealth::judge_flux(const Tick& tick, const PeriodPhasors::Result& result) noexcept {
  const float frequency = std::fabs(tick.frequency_rad_s);
  const Senses v = senses(result.voltage_v);
  const Senses i = senses(result.current_a);
  const float rated = config_.rated_flux_v_s;
  if (!(rated > 0.0F) || !(frequency >= kFluxFrom * config_.rated_frequency_rad_s) ||
      !(size(i.major) >= config_.current_floor_a) || state_.order_s > 0.0F ||
      state_.reverse_s > 0.0F) {
    state_.flux_s = 0.0F;  // of a wrong wiring the flux tells nothing
    return;
  }
  const float r = config_.stator_resistance_ohm;  // (E18)
  const SpaceVector e{v.major.alpha - r * i.major.alpha, v.major.beta - r * i.major.beta};
  // Above rated frequency the flux is weakened in proportion.
  const float least = kFluxLeast * rated * std::min(frequency, config_.rated_frequency_rad_s);
  const float most = kFluxMost * rated * frequency;
  const bool possible = size(v.major) >= least && size(e) >= least && size(e) <= most;
  state_.flux_s = possible ? 0.0F : state_.flux_s + state_.window_s;
  if (state_.flux_s >= kFluxPatience_s) state_.raw_latched = 1;
}

}  // namespace cutforce::estimator
