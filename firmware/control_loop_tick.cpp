#include "estimator/polynomials.hpp"
#include "firmware/control_loop.hpp"
#include "firmware/spindle_ratio.hpp"

// What the control tick is told besides the force, and the tick itself.

namespace cutforce::firmware {
namespace {

using hal::Signal;

constexpr float kForceMost_n = 1e9F;  // beyond any dynamometer; a sum of them stays finite
constexpr float kDiameterMost_m = 1e3F;

}  // namespace

// Of samples that carry the same. What says how things stand counts as the last of them has it.
void ControlLoop::note_commands(std::span<const hal::Sample> samples) noexcept {
  const hal::Sample& last = samples.back();
  own_.commands_present = last.present & kCommands;
  if (last.has(Signal::kFeedActive)) {
    // An active feed may still be the approach: contact is told from the torque then.
    own_.feed = last.feed_active <= 0.5F ? 1U : 0U;  // NaN: not known
  }
  if (last.has(Signal::kWorkpieceDiameter)) {
    const float diameter_m = last.workpiece_diameter_m;
    own_.diameter_m = diameter_m > 0.0F && diameter_m < kDiameterMost_m ? diameter_m : 0.0F;
  }
  if (last.has(Signal::kEnable)) own_.enabled = last.enable > 0.5F ? 1U : 0U;
  own_.override_reported = last.has(Signal::kOverrideApplied) ? 1U : 0U;
  own_.override_reported_pct = last.override_applied_pct;
  if (last.has(Signal::kPartStart) || own_.part_signal != 0) {
    for (const hal::Sample& sample : samples) note_part_start(sample);
  }
  if (config_.estimator != EstimatorName::kDynamometer) return;
  for (const hal::Sample& sample : samples) {
    const float force_n = sample.measured_force_n;
    if (!sample.has(Signal::kMeasuredForce) || !(estimator::magnitude(force_n) < kForceMost_n))
      continue;
    own_.dynamometer_n += force_n;
    ++own_.dynamometer_count;
  }
}

// A start that is held is still one start.
void ControlLoop::note_part_start(const hal::Sample& sample) noexcept {
  const bool part = sample.has(Signal::kPartStart) && sample.part_start > 0.5F;
  if (part && own_.part_signal == 0) own_.part_start = 1;
  own_.part_signal = part ? 1U : 0U;
}

void ControlLoop::permit(const control::Permission& permission) noexcept {
  own_.permitted = permission.enable ? 1U : 0U;
  own_.may_rise = permission.may_rise ? 1U : 0U;
  own_.ceiling_pct = permission.ceiling_pct;
  own_.floor_pct = permission.floor_pct;
  own_.force_reference_n = permission.force_reference_n;
}

control::Permission ControlLoop::permission() const noexcept {
  return {.enable = config_.control && own_.enabled != 0 && own_.permitted != 0,
          .may_rise = own_.may_rise != 0,
          .ceiling_pct = own_.ceiling_pct,
          .floor_pct = own_.floor_pct,
          .force_reference_n = own_.force_reference_n};
}

void ControlLoop::control_tick(LoopOutput& out) noexcept {
  const bool valid = own_.force_count > 0 && own_.force_due == 0;
  const float count = own_.force_count > 0 ? static_cast<float>(own_.force_count) : 1.0F;
  const float speed_rad_s =
      own_.speed_count > 0 ? own_.speed_sum_rad_s / static_cast<float>(own_.speed_count) : 0.0F;
  const auto controlled =
      controller_.step({.force_n = own_.force_n / count,
                        .force_sigma_n = own_.force_sigma_n / count,
                        .force_age_ticks = 0,
                        .override_reported_pct = own_.override_reported_pct,
                        .spindle_ratio = spindle_ratio(speed_rad_s, config_.programmed_speed_rad_s),
                        .force_valid = valid,
                        .override_reported = own_.override_reported != 0,
                        .permission = permission(),
                        .part_start = own_.part_start != 0});
  command_ = {.time_ns = time_ns(),
              .override_pct = controlled.override_pct,
              .override_code = controlled.override_code,
              .controlling = controlled.controlling};
  own_.law = controlled.law;
  own_.saturated_low = controlled.saturated_low ? 1U : 0U;
  own_.saturated_high = controlled.saturated_high ? 1U : 0U;
  own_.part_start = 0;
  own_.speed_sum_rad_s = 0.0F;
  own_.speed_count = 0;
  own_.force_n = own_.force_sigma_n = 0.0F;
  own_.force_count = own_.force_due = 0;
  out.control_tick = true;
}

void ControlLoop::publish_control(LoopOutput& out) const noexcept {
  if (!config_.control) return;
  out.override_pct = static_cast<float>(command_.override_pct);
  out.present |= LoopOutput::kOverride;
  out.saturated_low = own_.saturated_low != 0;
  out.saturated_high = own_.saturated_high != 0;
  if (own_.law.process_gain_n_pct > 0.0F) {
    out.process_gain_n_pct = own_.law.process_gain_n_pct;
    out.process_gain_sigma_ratio = own_.law.process_gain_sigma_ratio;
    out.present |= LoopOutput::kProcessGain;
  }
  if (own_.law.stability_margin_ratio > 0.0F) {
    out.stability_margin_ratio = own_.law.stability_margin_ratio;
    out.present |= LoopOutput::kStabilityMargin;
  }
}

}  // namespace cutforce::firmware
