// The tick. predictive_plan.hpp and gain_tracker_tick.hpp become one function with it; what is
// rare, or not every machine's, stands apart.
#include "control/predictive.hpp"

#include <algorithm>

#include "control/feed_power.hpp"
#include "control/gain_tracker_tick.hpp"
#include "control/predictive_plan.hpp"

namespace cutforce::control {
namespace {

constexpr float kEntry_ratio = 0.05F;   // of the reference: a reading above it ends the air
constexpr float kTelling_ratio = 0.2F;  // of the reference: force that tells of the dead time
constexpr float kTurns_s = 0.6F;        // jumps up and down within this time are in turn
constexpr float kDoubtGrowth = 1.6F;
constexpr float kDoubtMost = 16.0F;
constexpr float kOdd = -1.0F;  // a reading this low (standard deviations) is waited out

}  // namespace

void Predictive::begin_part() noexcept {
  tracker_.restart();
  map_.start();
}

// Another decides, and the force tells nothing.
auto Predictive::hold(const KnownFeed& feed, float speed, float applied_pct) noexcept -> Output {
  tracker_.coast(feed.mean * speed);
  if (config_.learns && map_.records()) map_.pass(feed_ratio(feed.mean));  // the tool moves on
  return law_answer(applied_pct);
}

void Predictive::find_latency(const Input& input, bool jumped) noexcept {
  const bool usable = input.phase == CutPhase::kCut && !jumped &&
                      input.force_n > kTelling_ratio * input.force_reference_n;
  const float before_s = bank_.state().latency_s;
  const auto found =
      bank_.step({.sent = {sent(), kHistory}, .reading_n = input.force_n, .usable = usable});
  if (found.latency_s != before_s) assume_latency(found.latency_s);
}

// Jumps up and down in turn are more likely our own moves, seen at the wrong time, than the part's:
// then what a move may do at an unknown moment is believed to be more. (C106)
void Predictive::note_jump(bool rising, float gain_before_n) noexcept {
  Own& s = own_;
  const bool turned = (rising ? 1U : 0U) != s.last_rising;
  if (turned && s.since_jump_s < kTurns_s) {
    s.timing_doubt = std::min(kDoubtGrowth * s.timing_doubt, kDoubtMost);
  }
  s.last_rising = rising ? 1U : 0U;
  s.since_jump_s = 0.0F;
  s.before_jump_n = rising ? 0.0F : std::max(gain_before_n, s.before_jump_n);
}

// What the override did to the feed since the last tick: mean of v. (C70)-(C73)
inline auto Predictive::known_feed(float applied_pct) noexcept -> KnownFeed {
  Own& s = own_;
  float now = sent()[0];
  if (applied_pct == s.sent_pct) {
    s.held_s += config_.period_s;
  } else {
    now = applied_pct > 0.0F ? feed_power(0.01F * applied_pct, config_.feed_exponent) : 0.0F;
    s.held_s = 0.0F;
    s.sent_pct = applied_pct;
  }
  s.newest = (s.newest == 0 ? kHistory : s.newest) - 1;
  s.sent[s.newest] = s.sent[s.newest + kHistory] = now;
  const float before_w = sent()[whole_ticks_ + 1];
  const float after_w = sent()[whole_ticks_];
  FeedState feed = s.feed;
  const float first = feed.advance(early_, before_w);
  const float second = feed.advance(late_, after_w);
  s.feed = feed;
  const float step = after_w - before_w;
  return {.mean = early_share_ * first + late_share_ * second,
          .sigma = estimator::magnitude(step) * latency_sigma_ratio_};
}

inline float Predictive::feed_ratio(float w) noexcept {
  if (w != asked_w_) {
    asked_w_ = w;
    answered_ratio_ = w > 1e-4F ? feed_power(w, inverse_exponent_) : 0.0F;
  }
  return answered_ratio_;
}

inline void Predictive::learn(const GainTracker::Output& seen, float feed, bool settled) noexcept {
  if (!map_.records()) return;  // the way begins with the part
  const float ratio = feed_ratio(feed);
  map_.learn({.feed_ratio = ratio,
              .gain_n = seen.gain_n,
              .jumped = seen.jumped,
              .rising = seen.rising,
              .resolving = seen.resolving,
              .steady = settled && seen.trend < 0.3F});
}

inline float Predictive::within_map(float wanted_pct, const Forecast& ahead,
                                    const Input& input) noexcept {
  return map_.limit({.reference_n = input.force_reference_n,
                     .ahead_s = ahead.path_s,
                     .force_n = ahead.force_n,
                     .override_pct = wanted_pct,
                     .spindle_ratio = input.spindle_ratio,
                     .air = input.phase == CutPhase::kAir});
}

auto Predictive::step(const Input& input) noexcept -> Output {
  Own& s = own_;
  if (input.part_start) [[unlikely]] {
    begin_part();
  }
  const float applied_pct = input.override_applied_pct;
  const float reference_n = input.force_reference_n;
  const float speed = input.spindle_ratio != 1.0F && input.spindle_ratio > 0.0F
                          ? feed_power(input.spindle_ratio, -config_.feed_exponent)
                          : 1.0F;
  const KnownFeed feed = known_feed(applied_pct);
  if (input.mode == LawMode::kHold) [[unlikely]] {
    return hold(feed, speed, applied_pct);
  }
  const float gain_before_n = tracker_.gain_n();
  const auto seen = tracker_.step({.reading_n = input.force_n,
                                   .feed = feed.mean * speed,
                                   .feed_sigma = feed.sigma * speed * s.timing_doubt,
                                   .entry_n = kEntry_ratio * reference_n,
                                   .air = input.phase == CutPhase::kAir});
  s.timing_doubt += doubt_share_ * (1.0F - s.timing_doubt);
  if (seen.jumped) [[unlikely]] {
    note_jump(seen.rising, gain_before_n);
  } else {
    s.since_jump_s = std::min(s.since_jump_s + config_.period_s, kLong_s);
  }
  const bool settled = s.since_jump_s > kLost_s;
  const bool calm = settled && input.phase == CutPhase::kCut;

  const float spread_ratio = seen.gain_n > 0.0F ? seen.gain_sigma_n / seen.gain_n : 0.0F;
  const float gain_n = pessimistic_gain_n(seen, spread_ratio);
  const bool rise = may_rise(seen, input.phase);
  fear(seen, gain_n, rise, input.phase);

  const Forecast ahead = forecast(seen.force_n, gain_n * speed);
  if (config_.finds_latency) find_latency(input, seen.jumped);
  if (config_.learns) learn(seen, feed.mean, calm);
  const Horizon& chosen = horizon(seen, ahead.force_n, reference_n, settled);
  float wanted = wanted_pct(ahead, chosen, s.feared_n * speed, reference_n, settled);
  // A low reading in a calm cut may be the first of a broken tool, (C91).
  const bool odd = calm && seen.innovation < kOdd;
  if (!rise || odd) wanted = std::min(wanted, applied_pct);
  if (config_.learns) {
    if (map_.limits()) wanted = within_map(wanted, ahead, input);
    wanted = std::max(wanted, config_.floor_pct);
  }
  return {
      .override_pct = input.mode == LawMode::kActive ? as_code(wanted, applied_pct) : applied_pct,
      .process_gain_n_pct = 0.01F * seen.gain_n,
      .process_gain_sigma_ratio = spread_ratio,
      .stability_margin_ratio =
          seen.gain_n > 0.0F ? chosen.stable_gain_ratio * s.feared_n / seen.gain_n : 0.0F};
}

}  // namespace cutforce::control
