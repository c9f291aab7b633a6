#include "control/predictive.hpp"

#include <algorithm>
#include <cmath>

namespace cutforce::control {
namespace {

using estimator::exp_bounded;
using estimator::power_positive;

constexpr float kAfterJump_s = 0.35F;
constexpr float kEntry_ratio = 0.05F;   // of the reference: a reading above it ends the air
constexpr float kTelling_ratio = 0.2F;  // of the reference: force that tells of the dead time
constexpr float kTurns_s = 0.6F;        // jumps up and down within this time are in turn
constexpr float kDoubtGrowth = 1.6F;
constexpr float kDoubtMost = 16.0F;
constexpr float kDoubtMemory_s = 20.0F;
constexpr float kLost_s = 0.5F;  // after which a cut that is left is a light one
constexpr float kOdd = -1.0F;    // a reading this low (standard deviations) is waited out

}  // namespace

auto Predictive::make(const Config& config) noexcept -> std::expected<Predictive, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  if (!detail::tracker_config(config).check() || !detail::map_config(config).check())
    return std::unexpected{ConfigError::kGain};
  if (!detail::bank_config(config).check()) return std::unexpected{ConfigError::kLatency};
  return Predictive{config};
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
void Predictive::doubt_timing(const GainTracker::Output& seen) noexcept {
  Own& s = own_;
  s.timing_doubt += config_.period_s / kDoubtMemory_s * (1.0F - s.timing_doubt);
  if (!seen.jumped) return;
  const bool turned = (seen.rising ? 1U : 0U) != s.last_rising;
  if (turned && s.since_jump_s < kTurns_s) {
    s.timing_doubt = std::min(kDoubtGrowth * s.timing_doubt, kDoubtMost);
  }
  s.last_rising = seen.rising ? 1U : 0U;
}

// What the override did to the feed since the last tick: mean of v. (C70)-(C73)
auto Predictive::known_feed(float applied_pct) noexcept -> KnownFeed {
  Own& s = own_;
  const float now = applied_pct == s.sent_pct ? sent()[0]
                    : applied_pct > 0.0F
                        ? power_positive(0.01F * applied_pct, config_.feed_exponent)
                        : 0.0F;
  s.newest = (s.newest == 0 ? kHistory : s.newest) - 1;
  s.sent[s.newest] = s.sent[s.newest + kHistory] = now;
  s.held_s = applied_pct == s.sent_pct ? s.held_s + config_.period_s : 0.0F;
  s.sent_pct = applied_pct;
  const float before_w = sent()[whole_ticks_ + 1];
  const float after_w = sent()[whole_ticks_];
  const float first = s.feed.advance(early_, config_.feed_lag_s, before_w);
  const float second = s.feed.advance(late_, config_.feed_lag_s, after_w);
  const float step = after_w - before_w;
  return {.mean = (early_.length_s * first + late_.length_s * second) / config_.period_s,
          .sigma = estimator::magnitude(step) * config_.latency_sigma_s / config_.period_s};
}

float Predictive::feed_ratio(float w) noexcept {
  if (w != asked_w_) {
    asked_w_ = w;
    answered_ratio_ = w > 1e-4F ? power_positive(w, inverse_exponent_) : 0.0F;
  }
  return answered_ratio_;
}

void Predictive::learn(const GainTracker::Output& seen, float feed, CutPhase phase) noexcept {
  const bool settled = own_.since_jump_s > kLost_s && phase == CutPhase::kCut;
  map_.learn({.feed_ratio = feed_ratio(feed),
              .gain_n = seen.gain_n,
              .jumped = seen.jumped,
              .rising = seen.rising,
              .resolving = seen.resolving,
              .steady = settled && seen.trend < 0.3F});
}

// A gain that was higher is forgotten slowly, faster once rising is allowed again. (C85)
void Predictive::fear(const GainTracker::Output& seen, float gain_n, bool rise,
                      CutPhase phase) noexcept {
  Own& s = own_;
  s.recovering_s =
      seen.jumped || !rise ? 0.0F : std::min(s.recovering_s + config_.period_s, 100.0F);
  const float left = s.recovering_s < kAfterJump_s ? forgets_after_jump_ratio_ : forgets_ratio_;
  const float kept = rise ? s.feared_n * left : s.feared_n;
  s.feared_n = phase == CutPhase::kAir && !seen.resolving ? 0.0F : std::max(gain_n, kept);
}

float Predictive::within_map(float wanted_pct, const Forecast& ahead, const Input& input) noexcept {
  return std::max(map_.limit({.reference_n = input.force_reference_n,
                              .ahead_s = ahead.path_s,
                              .force_n = ahead.force_n,
                              .override_pct = wanted_pct,
                              .spindle_ratio = input.spindle_ratio,
                              .air = input.phase == CutPhase::kAir}),
                  config_.floor_pct);
}

auto Predictive::step(const Input& input) noexcept -> Output {
  Own& s = own_;
  if (input.part_start) {
    tracker_.restart();
    map_.start();
  }
  const float speed = input.spindle_ratio > 0.0F && input.spindle_ratio != 1.0F
                          ? power_positive(input.spindle_ratio, -config_.feed_exponent)
                          : 1.0F;
  const KnownFeed feed = known_feed(input.override_applied_pct);
  if (input.mode == LawMode::kHold) {
    tracker_.coast(feed.mean * speed);
    if (config_.learns) map_.pass(feed_ratio(feed.mean));  // the tool moves on
    return law_answer(input.override_applied_pct);
  }
  const float gain_before_n = tracker_.state().gain_n;
  const auto seen = tracker_.step({.reading_n = input.force_n,
                                   .feed = feed.mean * speed,
                                   .feed_sigma = feed.sigma * speed * s.timing_doubt,
                                   .entry_n = kEntry_ratio * input.force_reference_n,
                                   .air = input.phase == CutPhase::kAir});
  doubt_timing(seen);
  s.since_jump_s = seen.jumped ? 0.0F : std::min(s.since_jump_s + config_.period_s, 100.0F);
  if (seen.jumped) s.before_jump_n = seen.rising ? 0.0F : std::max(gain_before_n, s.before_jump_n);

  const float gain_n = pessimistic_gain_n(seen);
  const bool rise = may_rise(seen, input.phase);
  fear(seen, gain_n, rise, input.phase);

  const Forecast ahead = forecast(seen.force_n, gain_n * speed);
  Forecast feared = ahead;
  feared.drive_n = s.feared_n * speed;
  if (config_.finds_latency) find_latency(input, seen.jumped);
  if (config_.learns) learn(seen, feed.mean, input.phase);
  const Horizon& horizon = horizons_[with_margin(reach(ahead, input.force_reference_n), seen)];
  float wanted = wanted_pct(feared, horizon, input.force_reference_n);
  // A low reading in a calm cut may be the first of a broken tool, (C91).
  const bool odd =
      input.phase == CutPhase::kCut && s.since_jump_s > kLost_s && seen.innovation < kOdd;
  if (!rise || odd) wanted = std::min(wanted, input.override_applied_pct);
  if (config_.learns) wanted = within_map(wanted, ahead, input);
  Output out =
      law_answer(input.mode == LawMode::kActive ? as_code(wanted, input.override_applied_pct)
                                                : input.override_applied_pct);
  out.process_gain_n_pct = 0.01F * seen.gain_n;
  if (seen.gain_n > 0.0F) {
    out.stability_margin_ratio = stable_gain_ratio(horizon) * s.feared_n / seen.gain_n;
  }
  out.process_gain_sigma_ratio = seen.gain_n > 0.0F ? seen.gain_sigma_n / seen.gain_n : 0.0F;
  return out;
}

void Predictive::rejoin() noexcept {
  tracker_.restart();
  map_.lose_place();
  own_ = Own{};
  own_.sent.fill(1.0F);
  own_.feed.v = 1.0F;
}

auto Predictive::state() const noexcept -> State {
  return {.tracker = tracker_.state(), .map = map_.state(), .bank = bank_.state(), .own = own_};
}

void Predictive::restore(const State& state) noexcept {
  own_ = state.own;
  tracker_.restore(state.tracker);
  map_.restore(state.map);
  bank_.restore(state.bank);
  assume_latency(state.bank.latency_s);
}

}  // namespace cutforce::control
