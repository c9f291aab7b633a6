#include "control/path_map.hpp"

#include <algorithm>

#include "estimator/polynomials.hpp"

namespace cutforce::control {
namespace {

using estimator::power_positive;

constexpr float kScale = 1024.0F;       // of e
constexpr std::uint16_t kFree = 65535;  // air, or so light a cut that nothing limits
constexpr float kMargin_s = 0.04F;      // path: a part lies this much off, perhaps
constexpr float kBehind_s = 0.02F;      // path: a cell holds this long after it was passed
constexpr float kServo_ratio = 1.5F;    // braking takes this many lags of the servo
constexpr float kFlat_ratio = 1.15F;    // cells this close to each other are averaged
constexpr float kShare = 0.5F;          // of the new part in a cell that changes
constexpr float kWearLeast = 0.7F;
constexpr float kWearMost = 1.5F;
constexpr float kWearMemory_s = 1.0F;
constexpr float kFar_ratio = 1.3F;     // a gain this far off the map's tells nothing of wear
constexpr float kDoubt_ratio = 0.75F;  // of the reference
constexpr float kDoubt_s = 0.7F;
constexpr float kDoubtWay_s = 0.3F;  // path: the cell may begin this much early
constexpr float kDoubtInAir_s = 1.75F;

constexpr std::size_t index_of(float position_s) noexcept {
  if (!(position_s > 0.0F)) return 0;
  const auto cell = static_cast<std::size_t>(position_s / PathMap::kCell_s);
  return std::min(cell, PathMap::kCells - 1);
}

}  // namespace

std::uint16_t PathMap::cell_of(float gain_n) const noexcept {  // (C93)
  if (!(gain_n > 0.02F * config_.gain_n)) return kFree;
  const float e = power_positive(gain_n / config_.gain_n, -1.0F / config_.feed_exponent);
  return static_cast<std::uint16_t>(std::clamp(kScale * e, 1.0F, 65534.0F));
}

// All cells from the last one written to the one at `position_s`.
void PathMap::write_to(float position_s, float gain_n) noexcept {
  State& s = state_;
  const auto end = static_cast<std::uint32_t>(index_of(position_s)) + (position_s > 0.0F ? 1U : 0U);
  if (end <= s.written) return;
  const std::uint16_t cell = cell_of(gain_n);
  for (; s.written < end; ++s.written) s.recorded[s.written] = cell;
}

void PathMap::pass(float feed_ratio) noexcept {  // (C92)
  State& s = state_;
  s.earlier_s = {s.position_s, s.earlier_s[0]};
  s.position_s += feed_ratio * config_.period_s;
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
    if (lesson.rising) write_to(s.earlier_s[1], s.last_gain_n);
  }
  s.resolving = lesson.resolving ? 1U : 0U;
  if (lesson.resolving) {
    if (s.rising == 0) write_to(seen_s, s.last_gain_n);
    return;
  }
  write_to(seen_s, lesson.gain_n);
  s.last_gain_n = lesson.gain_n;
  const std::uint16_t known = s.learned[index_of(seen_s)];
  if (!lesson.steady || known == 0 || known == kFree || !(lesson.gain_n > 0.0F)) return;
  const float then_n =
      config_.gain_n * power_positive(static_cast<float>(known) / kScale, -config_.feed_exponent);
  const float ratio = lesson.gain_n / then_n;
  // (C98)
  if (!(ratio * kFar_ratio > s.wear_ratio && ratio < kFar_ratio * s.wear_ratio)) return;
  const float share = config_.period_s / (kWearMemory_s + config_.period_s);
  s.wear_ratio = std::clamp(s.wear_ratio + share * (ratio - s.wear_ratio), kWearLeast, kWearMost);
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
  float lowest_pct = question.override_pct;
  for (std::size_t cell = index_of(begin_s - kBehind_s); cell <= last; ++cell) {
    const std::uint16_t known = s.learned[cell];
    if (known == 0 || known == kFree) continue;
    const float there_pct = scale_pct * static_cast<float>(known);
    const float way_s = static_cast<float>(cell) * kCell_s - begin_s - kMargin_s;
    const float here_pct = (100.0F * way_s + brake_s * there_pct) * per_brake_1_s;
    lowest_pct = std::min(lowest_pct, std::max(there_pct, here_pct));
  }
  return lowest_pct;
}

float PathMap::limit(const Question& question) noexcept {
  State& s = state_;
  if (s.started == 0 || s.trusted == 0) return question.override_pct;
  const float scale_pct = 100.0F / kScale * question.spindle_ratio *
                          power_positive(question.reference_n / (config_.gain_n * s.wear_ratio),
                                         1.0F / config_.feed_exponent);  // (C94)
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

void PathMap::start() noexcept {  // (C96)
  State& s = state_;
  for (std::size_t k = 0; k < s.written; ++k) {
    std::uint32_t low = s.recorded[k];
    std::uint32_t high = low;
    std::uint32_t sum = 0;
    std::uint32_t count = 0;
    const std::size_t end = std::min<std::size_t>(k + 3, s.written);
    for (std::size_t n = k < 2 ? 0 : k - 2; n < end; ++n) {
      const std::uint32_t value = s.recorded[n];
      low = std::min(low, value);
      high = std::max(high, value);
      sum += value;
      ++count;
    }
    const bool flat = static_cast<float>(high) < kFlat_ratio * static_cast<float>(low);
    const auto now = flat ? static_cast<float>(sum) / static_cast<float>(count)
                          : static_cast<float>(s.recorded[k]);
    const auto before = static_cast<float>(s.learned[k]);
    // What is heavier than known is believed at once, what is lighter by half.
    const bool believed = s.learned[k] == 0 || kFlat_ratio * now < before;
    s.learned[k] = static_cast<std::uint16_t>(believed ? now : before + kShare * (now - before));
  }
  s.position_s = 0.0F;
  s.earlier_s = {};
  s.last_gain_n = 0.0F;
  s.doubt_s = 0.0F;
  s.wear_ratio = 1.0F;
  s.written = 0;
  s.resolving = 0;
  s.started = 1;
  s.trusted = 1;
}

}  // namespace cutforce::control
