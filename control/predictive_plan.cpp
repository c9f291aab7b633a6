// From what is known of the process to an override: forecast, horizon, command, code, guards.
#include "control/predictive.hpp"

#include <algorithm>
#include <cmath>

namespace cutforce::control {
namespace {

using estimator::exp_bounded;
using estimator::power_positive;

constexpr float kSpreadFree = 0.04F;  // spread of the gain that is not feared
constexpr float kSpreadMost = 0.6F;
constexpr float kLead = 0.5862F;        // of a gain that drifts upwards
constexpr float kDeepRetreat_s = 0.4F;  // after a jump
constexpr float kAbove_ratio = 1.04F;
constexpr float kFarAbove_ratio = 1.15F;
constexpr float kOver_ratio = 1.05F;  // static force of a command, over the reference
constexpr float kOverAfterJump_ratio = 1.15F;
constexpr float kKeep_ratio = 0.03F;  // of the override: not worth a change at first
constexpr float kKeepFade_s = 1.5F;
constexpr float kCoarse_ratio = 0.04F;    // of the override: coarser steps are rounded down
constexpr float kMarginLeast = 1.6F;      // the loop must bear this much more than the highest gain
constexpr float kConfidence = 2.0F;       // standard deviations up to it
constexpr float kLost_ratio = 0.2F;       // of the gain before: less is a lost cut
constexpr float kLongSuspected_s = 1.0F;  // at the most, however the gain goes on jumping
constexpr float kLost_s = 0.5F;           // after which a cut that is left is a light one

}  // namespace

// To the end of the dead time, with the codes that are on their way. (C86)
auto Predictive::forecast(float force_n, float drive_n) noexcept -> Forecast {
  FeedState feed = own_.feed;
  float path_s = 0.0F;
  const auto go = [&](const LagStep& step, float w) {
    const float mean = feed.advance(step, config_.feed_lag_s, w);
    if (map_.limits()) path_s += step.length_s * feed_ratio(mean);  // nobody else asks
    force_n = step.cut * force_n + (1.0F - step.cut) * drive_n * mean;
  };
  if (early_.length_s > 0.0F) go(early_, sent()[whole_ticks_]);
  for (std::size_t k = whole_ticks_; k > 0; --k) go(tick_, sent()[k - 1]);
  return {.force_n = force_n, .feed = feed.v, .path_s = path_s, .drive_n = drive_n};
}

// (C84), (C85)
float Predictive::pessimistic_gain_n(const GainTracker::Output& seen) noexcept {
  Own& s = own_;
  const float period_s = config_.period_s;
  if (!(seen.gain_n > 0.0F)) {
    s.last_gain_n = 0.0F;
    return 0.0F;
  }
  if (s.last_gain_n > 0.0F && !seen.resolving) {
    const float slope_1_s = (seen.gain_n - s.last_gain_n) / (seen.gain_n * period_s);
    s.trend_1_s += period_s / (0.25F + period_s) * (slope_1_s - s.trend_1_s);
  } else {
    s.trend_1_s = 0.0F;
  }
  s.last_gain_n = seen.gain_n;
  const float spread = std::min(seen.gain_sigma_n / seen.gain_n, kSpreadMost);
  const float ahead_s = bank_.state().latency_s + period_s + 0.5F * config_.process_lag_s;
  const float lead =
      seen.trend > 0.1F ? std::clamp(kLead * s.trend_1_s * ahead_s, 0.0F, 0.3F) : 0.0F;
  return seen.gain_n * (1.0F + config_.caution_ratio * std::max(spread - kSpreadFree, 0.0F)) *
         (1.0F + lead);
}

// (C87)
auto Predictive::reach(const Forecast& ahead, float reference_n) const noexcept -> Reach {
  const bool recent = own_.since_jump_s < kDeepRetreat_s;
  if (ahead.force_n > kAbove_ratio * reference_n) {
    return recent || ahead.force_n > kFarAbove_ratio * reference_n ? kOneTick : kMiddle;
  }
  return recent ? kTwoTicks : kCalm;
}

// How many times the gain that the law works with the true one may be. (C104)
float Predictive::stable_gain_ratio(const Horizon& horizon) const noexcept {
  const float decay = tick_.cut;
  const float loop = horizon.force / (1.0F - horizon.force) * (1.0F - decay);
  return 1.0F + (1.0F - estimator::magnitude(decay - loop)) / (loop * dead_decay_);
}

// A longer horizon while the gain may be too uncertain for a short one. (C105)
auto Predictive::with_margin(Reach reach, const GainTracker::Output& seen) const noexcept -> Reach {
  const float highest_n = seen.gain_n + kConfidence * seen.gain_sigma_n;
  while (reach != kCalm &&
         stable_gain_ratio(horizons_[reach]) * own_.feared_n < kMarginLeast * highest_n) {
    reach = static_cast<Reach>(reach + 1);
  }
  return reach;
}

// The override that brings the force to the reference at the end of the horizon. (C88), (C89)
float Predictive::wanted_pct(const Forecast& ahead, const Horizon& horizon,
                             float reference_n) const noexcept {
  if (!(ahead.drive_n > 1e-3F * reference_n)) return config_.ceiling_pct;
  const float own = 1.0F - horizon.force - horizon.feed;
  const float w =
      (reference_n - horizon.force * ahead.force_n - ahead.drive_n * horizon.feed * ahead.feed) /
      (ahead.drive_n * own);
  const float over = own_.since_jump_s < kLost_s ? kOverAfterJump_ratio : kOver_ratio;
  const float most = over * reference_n / ahead.drive_n;
  const float limited = std::min(w, most);
  if (!(limited > 1e-4F)) return config_.floor_pct;
  if (limited > 1e4F) return config_.ceiling_pct;
  return std::clamp(100.0F * power_positive(limited, inverse_exponent_), config_.floor_pct,
                    config_.ceiling_pct);
}

// A code that the CNC has, and not a new one for nothing. (C90)
float Predictive::as_code(float wanted_pct, float sent_pct) const noexcept {
  const auto step = static_cast<float>(config_.step_pct);
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
  if (apart <= most && apart <= most * exp_bounded(-own_.held_s / kKeepFade_s)) return sent_pct;
  return down(wanted_pct + 0.5F * step);
}

// Not with a jump upwards, and not while the tool may be broken. (C91)
bool Predictive::may_rise(const GainTracker::Output& seen, CutPhase phase) noexcept {
  Own& s = own_;
  if (phase == CutPhase::kAir && !seen.resolving) {
    s.before_jump_n = 0.0F;
    return true;
  }
  s.suspected_s = s.before_jump_n > 0.0F ? s.suspected_s + config_.period_s : 0.0F;
  if (s.before_jump_n > 0.0F) {
    // Not with the first two readings: where noise made the first of them low, a force that
    // vanishes looks like one that falls a little, and earlier.
    const bool surely_cutting =
        !seen.jumped && seen.gain_n - 3.0F * seen.gain_sigma_n > kLost_ratio * s.before_jump_n;
    const bool light_cut =
        phase == CutPhase::kCut && (s.since_jump_s > kLost_s || s.suspected_s > kLongSuspected_s);
    if (surely_cutting || light_cut) s.before_jump_n = 0.0F;
  }
  return s.before_jump_n <= 0.0F && !(seen.jumped && seen.rising);
}

}  // namespace cutforce::control
