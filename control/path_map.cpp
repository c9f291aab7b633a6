#include "control/path_map.hpp"

#include <algorithm>

#include "control/feed_power.hpp"

namespace cutforce::control {
namespace {

constexpr float kScale = 1024.0F;     // of e
constexpr float kMargin_s = 0.04F;    // path: a part lies this much off, perhaps
constexpr float kBehind_s = 0.02F;    // path: a cell holds this long after it was passed
constexpr float kServo_ratio = 1.5F;  // braking takes this many lags of the servo
// Cells closer to each other than by 1.15 are averaged: 23/20.
constexpr std::uint32_t kFlatUnder = 23;
constexpr std::uint32_t kFlatOver = 20;
constexpr float kWearMemory_s = 1.0F;
constexpr float kDoubt_ratio = 0.75F;  // of the reference
constexpr float kDoubt_s = 0.7F;
constexpr float kDoubtWay_s = 0.3F;  // path: the cell may begin this much early
constexpr float kDoubtInAir_s = 1.75F;

constexpr std::uint16_t cell_of(float e) noexcept {
  return e > 0.0F ? static_cast<std::uint16_t>(std::clamp(kScale * e, 1.0F, 65534.0F))
                  : PathMap::kFree;
}

constexpr std::size_t index_of(float position_s) noexcept {
  if (!(position_s > 0.0F)) return 0;
  const auto cell = static_cast<std::size_t>(position_s / PathMap::kCell_s);
  return std::min(cell, PathMap::kCells - 1);
}

}  // namespace

// e of a gain; 0 where nothing limits. (C93)
float PathMap::feed_at_reference(float gain_n) const noexcept {
  if (!(gain_n > 0.02F * config_.gain_n)) return 0.0F;
  return feed_power(gain_n / config_.gain_n, -inverse_exponent_);
}

// In whole numbers, which say the same as fractions would. What is heavier than known is believed
// at once, what is lighter by half. (C96)
inline void PathMap::merge(std::uint32_t cell, std::uint32_t sum, std::uint32_t count) noexcept {
  std::uint16_t& known = state_.learned[cell];
  const bool believed = known == 0 || kFlatUnder * sum < kFlatOver * count * known;
  known = static_cast<std::uint16_t>(believed ? sum / count : (count * known + sum) / (2 * count));
}

// All cells from the last one written to the one at `position_s`.
void PathMap::write_to(float position_s, std::uint16_t cell) noexcept {
  State& s = state_;
  const auto end = static_cast<std::uint32_t>(index_of(position_s)) + (position_s > 0.0F ? 1U : 0U);
  if (end <= s.written) return;
  std::array<std::uint32_t, 5> w;  // the window moves on in registers
  for (std::size_t k = 0; k < 5; ++k) w[k] = s.recorded[k];
  for (std::uint32_t alike = 1; s.written < end; ++alike) {
    w = {w[1], w[2], w[3], w[4], cell};
    ++s.written;
    if (alike >= 5) {
      merge(s.written - 3, cell, 1);
    } else if (s.written >= 5) {
      const std::uint32_t low =
          std::min(std::min(w[0], w[1]), std::min(std::min(w[2], w[3]), w[4]));
      const std::uint32_t high =
          std::max(std::max(w[0], w[1]), std::max(std::max(w[2], w[3]), w[4]));
      const bool flat = kFlatOver * high < kFlatUnder * low;
      merge(s.written - 3, flat ? w[0] + w[1] + w[2] + w[3] + w[4] : w[2], flat ? 5 : 1);
    } else {
      for (std::size_t k = 0; k < 5; ++k) s.recorded[k] = static_cast<std::uint16_t>(w[k]);
      if (s.written >= 3) believe(s.written - 3, s.written);
    }
  }
  for (std::size_t k = 0; k < 5; ++k) s.recorded[k] = static_cast<std::uint16_t>(w[k]);
}

// At either end of a part, where neighbours are missing: the last `count` cells that were written
// are this one and its neighbours. (C96)
void PathMap::believe(std::uint32_t cell, std::uint32_t count) noexcept {
  const State& s = state_;
  const std::uint32_t own = s.recorded[5 - (s.written - cell)];
  std::uint32_t low = own;
  std::uint32_t high = own;
  std::uint32_t sum = 0;
  for (std::uint32_t k = 5 - count; k < 5; ++k) {
    const std::uint32_t value = s.recorded[k];
    low = std::min(low, value);
    high = std::max(high, value);
    sum += value;
  }
  const bool flat = kFlatOver * high < kFlatUnder * low;
  merge(cell, flat ? sum : own, flat ? count : 1);
}

void PathMap::learn(const Lesson& lesson) noexcept {
  State& s = state_;
  pass(lesson.feed_ratio);
  if (s.started == 0) return;
  // Where the tool was when the force arose that has just been read. (C99)
  const float late_s = config_.sensor_lag_s + 0.5F * config_.period_s;
  const float seen_s = s.position_s - lesson.feed_ratio * late_s;
  if (lesson.jumped && s.resolving == 0) {
    // Up to where the jump may have been, the old gain holds. After a jump down it holds until now.
    // Which it was is decided once: what looks different a tick later is the same surprise.
    s.rising = lesson.rising ? 1U : 0U;
    if (lesson.rising) write_to(s.earlier_s[1], static_cast<std::uint16_t>(s.last_cell));
  }
  s.resolving = lesson.resolving ? 1U : 0U;
  if (lesson.resolving) {
    if (s.rising == 0) write_to(seen_s, static_cast<std::uint16_t>(s.last_cell));
    return;
  }
  const float e = feed_at_reference(lesson.gain_n);
  const std::uint16_t cell = cell_of(e);
  write_to(seen_s, cell);
  s.last_cell = cell;
  const std::uint16_t known = s.learned[index_of(seen_s)];
  if (!lesson.steady || known == 0 || known == kFree || cell == kFree) return;
  follow_wear(e, static_cast<float>(known) * (1.0F / kScale));
}

// In the domain of the feed, where e stands already: no power of the gain is needed. (C98)
void PathMap::follow_wear(float feed_now, float feed_then) noexcept {
  float& wear = state_.wear_feed_ratio;
  const float ratio = feed_now / feed_then;
  if (!(ratio * wear_far_ratio_ > wear && ratio < wear_far_ratio_ * wear)) return;
  const float share = config_.period_s / (kWearMemory_s + config_.period_s);
  wear = std::clamp(wear + share * (ratio - wear), wear_least_ratio_, wear_most_ratio_);
}

// Lowest override that any cell within reach asks for, with the way there to brake. (C95)
float PathMap::slowest(const Question& question, float scale_pct) const noexcept {
  const State& s = state_;
  const float begin_s = s.position_s + question.ahead_s;
  const float brake_s = kServo_ratio * config_.feed_lag_s;
  const float per_brake_1_s = 1.0F / (config_.period_s + brake_s);
  const float reach_s =
      0.01F * question.override_pct * (config_.period_s + brake_s) + kMargin_s + kCell_s;
  const std::size_t last = index_of(begin_s + reach_s);
  // Most cells ask for no less, which their whole number tells: nothing known is the highest.
  const auto enough = [scale_pct](float pct) {
    return static_cast<std::uint32_t>(std::min(65534.0F, std::max(0.0F, pct / scale_pct + 1.0F)));
  };
  float lowest_pct = question.override_pct;
  std::uint32_t highest = enough(lowest_pct);
  for (std::size_t cell = index_of(begin_s - kBehind_s); cell <= last; ++cell) {
    const std::uint32_t known = s.learned[cell];
    if (known - 1U >= highest) continue;
    const float there_pct = scale_pct * static_cast<float>(known);
    const float way_s = static_cast<float>(cell) * kCell_s - begin_s - kMargin_s;
    const float here_pct = (100.0F * way_s + brake_s * there_pct) * per_brake_1_s;
    const float allowed_pct = std::max(there_pct, here_pct);
    if (allowed_pct >= lowest_pct) continue;
    lowest_pct = allowed_pct;
    highest = enough(lowest_pct);
  }
  return lowest_pct;
}

float PathMap::limit(const Question& question) noexcept {
  State& s = state_;
  if (!limits()) return question.override_pct;
  if (question.reference_n != reference_n_) {
    reference_n_ = question.reference_n;
    reference_feed_ = feed_power(reference_n_ / config_.gain_n, inverse_exponent_);
  }
  const float scale_pct =
      100.0F / kScale * question.spindle_ratio * reference_feed_ * s.wear_feed_ratio;  // (C94)
  const float allowed_pct = slowest(question, scale_pct);
  const bool held_down =
      allowed_pct < question.override_pct && question.force_n < kDoubt_ratio * question.reference_n;
  if (!held_down) {
    s.doubt_s = 0.0F;
    s.doubt_from_s = s.position_s;
  } else {
    s.doubt_s += config_.period_s;
  }
  const bool long_enough = s.doubt_s > (question.air ? kDoubtInAir_s : kDoubt_s);
  if (long_enough && s.position_s - s.doubt_from_s > kDoubtWay_s) s.trusted = 0;  // (C97)
  return allowed_pct;
}

void PathMap::start() noexcept {
  State& s = state_;
  if (s.written > 1) believe(s.written - 2, std::min(s.written, std::uint32_t{4}));
  if (s.written > 0) believe(s.written - 1, std::min(s.written, std::uint32_t{3}));
  s.position_s = 0.0F;
  s.earlier_s = {};
  s.last_cell = kFree;
  s.doubt_s = 0.0F;
  s.wear_feed_ratio = 1.0F;
  s.written = 0;
  s.resolving = 0;
  s.started = 1;
  s.trusted = 1;
}

}  // namespace cutforce::control
