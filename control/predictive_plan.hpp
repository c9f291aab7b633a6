// From what is known of the process to an override: caution, forecast, horizon, command, code.
// Parts of the tick in predictive.cpp, which alone includes this.
#pragma once

#include <algorithm>
#include <cstdint>

#include "control/feed_power.hpp"
#include "control/predictive.hpp"

namespace cutforce::control {

inline constexpr float kLong_s = 100.0F;      // as long as ever
inline constexpr float kLost_s = 0.5F;        // after which a cut that is left is a light one
inline constexpr float kAfterJump_s = 0.35F;  // of faster recovery

// (C84)
inline float Predictive::pessimistic_gain_n(const GainTracker::Output& seen,
                                            float spread_ratio) noexcept {
  constexpr float kSpreadFree = 0.04F;  // spread of the gain that is not feared
  constexpr float kSpreadMost = 0.6F;
  constexpr float kLead = 0.5862F;  // of a gain that drifts upwards
  Own& s = own_;
  if (!(seen.gain_n > 0.0F)) {
    s.last_gain_n = 0.0F;
    return 0.0F;
  }
  float trend_1_s = 0.0F;
  if (s.last_gain_n > 0.0F && !seen.resolving) {
    const float slope_1_s = (seen.gain_n - s.last_gain_n) / (seen.gain_n * config_.period_s);
    trend_1_s = s.trend_1_s + trend_share_ * (slope_1_s - s.trend_1_s);
  }
  s.trend_1_s = trend_1_s;
  s.last_gain_n = seen.gain_n;
  const float spread = std::min(spread_ratio, kSpreadMost);
  const float feared =
      seen.gain_n * (1.0F + config_.caution_ratio * std::max(spread - kSpreadFree, 0.0F));
  if (!(seen.trend > 0.1F)) return feared;
  return feared * (1.0F + std::clamp(kLead * trend_1_s * ahead_s_, 0.0F, 0.3F));
}

// Not with a jump upwards, and not while the tool may be broken. (C91)
inline bool Predictive::may_rise(const GainTracker::Output& seen, CutPhase phase) noexcept {
  constexpr float kLost_ratio = 0.2F;       // of the gain before: less is a lost cut
  constexpr float kLongSuspected_s = 1.0F;  // at the most, however the gain goes on jumping
  Own& s = own_;
  if (phase == CutPhase::kAir && !seen.resolving) {
    s.before_jump_n = 0.0F;
    return true;
  }
  if (!(s.before_jump_n > 0.0F)) {
    s.suspected_s = 0.0F;
    return !(seen.jumped && seen.rising);
  }
  s.suspected_s += config_.period_s;
  // Not with the first two readings: where noise made the first of them low, a force that
  // vanishes looks like one that falls a little, and earlier.
  const bool surely_cutting =
      !seen.jumped && seen.gain_n - 3.0F * seen.gain_sigma_n > kLost_ratio * s.before_jump_n;
  const bool light_cut =
      phase == CutPhase::kCut && (s.since_jump_s > kLost_s || s.suspected_s > kLongSuspected_s);
  if (!surely_cutting && !light_cut) return false;
  s.before_jump_n = 0.0F;
  return !(seen.jumped && seen.rising);
}

// A gain that was higher is forgotten slowly, faster once rising is allowed again. (C85)
inline void Predictive::fear(const GainTracker::Output& seen, float gain_n, bool rise,
                             CutPhase phase) noexcept {
  Own& s = own_;
  float kept = s.feared_n;
  float recovering_s = 0.0F;
  if (rise) {
    if (!seen.jumped) recovering_s = std::min(s.recovering_s + config_.period_s, kLong_s);
    kept *= recovering_s < kAfterJump_s ? forgets_after_jump_ratio_ : forgets_ratio_;
  }
  s.recovering_s = recovering_s;
  s.feared_n = phase == CutPhase::kAir && !seen.resolving ? 0.0F : std::max(gain_n, kept);
}

// To the end of the dead time, with the codes that are on their way. (C86)
inline auto Predictive::forecast(float force_n, float drive_n) noexcept -> Forecast {
  const bool measures = map_.limits();  // nobody else asks for the path
  FeedState feed = own_.feed;
  float path_s = 0.0F;
  const auto go = [&](const LagStep& step, float w) {
    const float mean = feed.advance(step, w);
    if (measures) path_s += step.length_s * feed_ratio(mean);
    force_n = step.cut * force_n + (1.0F - step.cut) * drive_n * mean;
  };
  if (early_.length_s > 0.0F) go(early_, sent()[whole_ticks_]);
  for (std::size_t k = whole_ticks_; k > 0; --k) go(tick_, sent()[k - 1]);
  return {.force_n = force_n, .feed = feed.v, .path_s = path_s};
}

// (C87), and a longer one while the gain may be too uncertain for a short one. (C105)
inline auto Predictive::horizon(const GainTracker::Output& seen, float force_n, float reference_n,
                                bool settled) const noexcept -> const Horizon& {
  constexpr float kDeepRetreat_s = 0.4F;  // after a jump
  static_assert(kDeepRetreat_s < kLost_s);
  constexpr float kAbove_ratio = 1.04F;
  constexpr float kFarAbove_ratio = 1.15F;
  constexpr float kMarginLeast = 1.6F;  // the loop must bear this much more than the highest gain
  constexpr float kConfidence = 2.0F;   // standard deviations up to it
  const bool recent = !settled && own_.since_jump_s < kDeepRetreat_s;
  std::size_t reach = kCalm;
  if (force_n > kAbove_ratio * reference_n) {
    reach = recent || force_n > kFarAbove_ratio * reference_n ? kOneTick : kMiddle;
  } else if (recent) {
    reach = kTwoTicks;
  }
  if (reach != kCalm) {
    const float highest_n = kMarginLeast * (seen.gain_n + kConfidence * seen.gain_sigma_n);
    while (reach != kCalm && horizons_[reach].stable_gain_ratio * own_.feared_n < highest_n) {
      ++reach;
    }
  }
  return horizons_[reach];
}

// The override that brings the force to the reference at the end of the horizon. (C88), (C89)
inline float Predictive::wanted_pct(const Forecast& ahead, const Horizon& horizon, float drive_n,
                                    float reference_n, bool settled) const noexcept {
  constexpr float kOver_ratio = 1.05F;  // static force of a command, over the reference
  constexpr float kOverAfterJump_ratio = 1.15F;
  if (!(drive_n > 1e-3F * reference_n)) return config_.ceiling_pct;
  const float w =
      (reference_n - horizon.force * ahead.force_n - drive_n * horizon.feed * ahead.feed) /
      (drive_n * horizon.command);
  const float over = !settled && own_.since_jump_s < kLost_s ? kOverAfterJump_ratio : kOver_ratio;
  const float limited = std::min(w, over * reference_n / drive_n);
  if (!(limited > 1e-4F)) return config_.floor_pct;
  if (limited > 1e4F) return config_.ceiling_pct;
  const float feed = inverse_exponent_ == 1.0F ? limited : feed_power(limited, inverse_exponent_);
  return std::clamp(100.0F * feed, config_.floor_pct, config_.ceiling_pct);
}

// A code that the CNC has, and not a new one for nothing. (C90)
inline float Predictive::as_code(float wanted_pct, float sent_pct) const noexcept {
  constexpr float kKeep_ratio = 0.03F;  // of the override: not worth a change at first
  constexpr float kKeepFade_s = 1.5F;
  constexpr float kCoarse_ratio = 0.04F;  // of the override: coarser steps are rounded down
  const float step = step_pct_;
  const auto down = [step](float pct) {
    return step * static_cast<float>(static_cast<std::int32_t>(pct / step + 1e-3F));
  };
  if (step > kCoarse_ratio * wanted_pct) {
    if (wanted_pct > sent_pct - 0.15F * step && wanted_pct < sent_pct + 1.25F * step) {
      return sent_pct;
    }
    return std::max(down(wanted_pct), config_.floor_pct);
  }
  const float apart = estimator::magnitude(wanted_pct - sent_pct);
  if (apart <= 0.6F * step) return sent_pct;
  const float most = kKeep_ratio * wanted_pct;  // before it fades
  if (apart <= most && apart <= most * estimator::exp_bounded(-own_.held_s / kKeepFade_s)) {
    return sent_pct;
  }
  return down(wanted_pct + 0.5F * step);
}

}  // namespace cutforce::control
