#include "control/latency_bank.hpp"

#include <algorithm>

namespace cutforce::control {
namespace {

constexpr float kMoves_ratio = 0.04F;  // a chain that changes by less within a tick tells nothing
constexpr float kMemory_s = 0.6F;      // of moving time
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

// One tick of a chain of unit gain; returns its relative change. (C100)
float LatencyBank::advance(Chain& chain, float latency_s,
                           std::span<const float> sent) const noexcept {
  const float ticks = latency_s / config_.period_s;
  const auto whole = static_cast<std::size_t>(ticks);
  const float part = ticks - static_cast<float>(whole);
  if (whole + 1 >= sent.size()) return 0.0F;
  const float w = part * sent[whole + 1] + (1.0F - part) * sent[whole];
  const float mean = chain.feed = w + (chain.feed - w) * tick_.feed;
  const float before = chain.sensed;
  chain.sensed =
      tick_.sensed * chain.sensed + tick_.sensed_force * chain.force + tick_.sensed_input * mean;
  chain.force = tick_.cut * chain.force + (1.0F - tick_.cut) * mean;
  return chain.sensed + before > kLeast_n ? relative_change(chain.sensed, before) : 0.0F;
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
  std::array<float, kCandidates> change{};
  bool moves = false;
  for (std::size_t k = 0; k < kCandidates; ++k) {
    change[k] = advance(s.chains[k], candidate_s(k), input.sent);
    moves = moves || change[k] > kMoves_ratio || change[k] < -kMoves_ratio;
  }
  const bool told = input.usable && s.reading_n > 0.0F && moves;
  const float seen = told ? relative_change(input.reading_n, s.reading_n) : 0.0F;
  s.reading_n = input.usable ? std::max(input.reading_n, kLeast_n) : 0.0F;
  std::size_t best = 0;
  if (told) {
    s.evidence = std::min(s.evidence + config_.period_s, 100.0F);
    const float share = config_.period_s / (kMemory_s + config_.period_s);
    for (std::size_t k = 0; k < kCandidates; ++k) {  // (C101)
      Chain& chain = s.chains[k];
      chain.misfit += share * ((seen - change[k]) * (seen - change[k]) - chain.misfit);
    }
  }
  for (std::size_t k = 1; k < kCandidates; ++k) {
    if (s.chains[k].misfit < s.chains[best].misfit) best = k;
  }
  const float present = s.chains[0].misfit;
  const float ratio = present > 0.0F ? s.chains[best].misfit / present : 1.0F;
  if (told) judge(best);
  return {.latency_s = s.latency_s, .misfit_ratio = ratio};  // (C103)
}

}  // namespace cutforce::control
