#include "control/latency_bank.hpp"

#include <algorithm>

namespace cutforce::control {
namespace {

constexpr float kMoves_ratio = 0.04F;  // a chain that changes by less within a tick tells nothing
constexpr float kEnough_s = 0.4F;      // of moving time, before anything is decided
constexpr float kBetter_ratio = 0.45F;
constexpr float kStep_s = 0.06F;  // the present dead time follows by this much at a time
constexpr float kLeast_n = 1e-3F;

constexpr float relative_change(float now, float before) noexcept {
  return 2.0F * (now - before) / (now + before);
}

}  // namespace

float LatencyBank::candidate_s(std::size_t k) const noexcept {
  if (k == 0) return state_.latency_s;
  return config_.most_latency_s * static_cast<float>(k - 1) / static_cast<float>(kCandidates - 2);
}

// One tick of a chain of unit gain, whose dead time is so many ticks; returns its relative change.
// (C100)
inline float LatencyBank::advance(Chain& chain, float ticks,
                                  std::span<const float> sent) const noexcept {
  const auto whole = static_cast<std::uint32_t>(ticks);
  if (whole + 1 >= sent.size()) return 0.0F;
  const float part = ticks - static_cast<float>(whole);
  const float w = part * sent[whole + 1] + (1.0F - part) * sent[whole];
  const float mean = w + (chain.feed - w) * tick_.feed;
  const float before = chain.sensed;
  const float now =
      tick_.sensed * before + tick_.sensed_force * chain.force + tick_.sensed_input * mean;
  chain.force = tick_.cut * chain.force + (1.0F - tick_.cut) * mean;
  chain.feed = mean;
  chain.sensed = now;
  return now + before > kLeast_n ? relative_change(now, before) : 0.0F;
}

// The present dead time goes towards a clearly better one. (C102)
void LatencyBank::judge(std::size_t best) noexcept {
  State& s = state_;
  if (s.evidence < kEnough_s || best == 0) return;
  if (s.chains[best].misfit > kBetter_ratio * s.chains[0].misfit) return;
  const float target_s = candidate_s(best);
  s.latency_s = std::clamp(target_s, s.latency_s - kStep_s, s.latency_s + kStep_s);
  s.chains[0] = s.chains[best];
  s.evidence = 0.5F * kEnough_s;
}

auto LatencyBank::step(const Input& input) noexcept -> Output {
  State& s = state_;
  std::array<float, kCandidates> change;
  change[0] = advance(s.chains[0], s.latency_s / config_.period_s, input.sent);
  float most = estimator::magnitude(change[0]);
  for (std::size_t k = 1; k < kCandidates; ++k) {
    change[k] = advance(s.chains[k], grid_ticks_ * static_cast<float>(k - 1), input.sent);
    most = std::max(most, estimator::magnitude(change[k]));
  }
  const bool told = input.usable && s.reading_n > 0.0F && most > kMoves_ratio;
  const float seen = told ? relative_change(input.reading_n, s.reading_n) : 0.0F;
  s.reading_n = input.usable ? std::max(input.reading_n, kLeast_n) : 0.0F;
  if (told) {
    s.evidence = std::min(s.evidence + config_.period_s, 100.0F);
    for (std::size_t k = 0; k < kCandidates; ++k) {  // (C101)
      const float off = seen - change[k];
      s.chains[k].misfit += share_ * (off * off - s.chains[k].misfit);
    }
  }
  const float present = s.chains[0].misfit;
  float least = present;
  std::size_t best = 0;
  for (std::size_t k = 1; k < kCandidates; ++k) {
    if (!(s.chains[k].misfit < least)) continue;
    least = s.chains[k].misfit;
    best = k;
  }
  const float ratio = present > 0.0F ? least / present : 1.0F;
  if (told) judge(best);
  return {.latency_s = s.latency_s, .misfit_ratio = ratio};  // (C103)
}

}  // namespace cutforce::control
