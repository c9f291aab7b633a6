// A law, the limits and rounding behind it and the simplest plant in a closed loop, without the
// rest of the control path: what the papers simulate. One tick is: the cut answers to what was
// sent, the law sees it, the answer is sent.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "control/feed_override.hpp"
#include "control/law.hpp"
#include "support/cutting_plant.hpp"

namespace cutforce::host_tests {

struct LawLoopTick {
  float force_n;
  float sent_before_pct;  // made force_n
  control::LawOutput law;
  std::uint8_t sent_pct;
};

struct LawLoopConfig {
  float force_reference_n;
  control::FeedOverride::Config feed_override;
  CuttingPlant::Config plant;
};

// depth_mm(tick) 0 is air: the law follows, the override rises to its ceiling.
template <class L, class Depth>
std::vector<LawLoopTick> run_law_loop(L& law, const LawLoopConfig& config, int ticks,
                                      const Depth& depth_mm) {
  auto feed_override = control::FeedOverride::make(config.feed_override).value();
  CuttingPlant plant(config.plant);
  std::vector<LawLoopTick> result;
  for (int i = 0; i < ticks; ++i) {
    const double now_mm = depth_mm(i);
    const bool air = !(now_mm > 0.0);
    const auto before_pct = static_cast<float>(feed_override.sent_pct());
    const auto force_n = static_cast<float>(plant.step(static_cast<double>(before_pct), now_mm));
    const auto answer =
        law.step({.force_reference_n = config.force_reference_n,
                  .force_n = force_n,
                  .force_sigma_n = 0.0F,
                  .override_applied_pct = before_pct,
                  .override_tolerance_pct = feed_override.tolerance_pct(),
                  .spindle_ratio = 1.0F,
                  .phase = air ? control::CutPhase::kAir : control::CutPhase::kCut,
                  .mode = air ? control::LawMode::kTrack : control::LawMode::kActive,
                  .part_start = i == 0});
    const float wanted_pct = air ? config.feed_override.ceiling_pct : answer.override_pct;
    const auto sent = feed_override.step({.wanted_pct = wanted_pct, .may_rise = true});
    result.push_back({.force_n = force_n,
                      .sent_before_pct = before_pct,
                      .law = answer,
                      .sent_pct = sent.override_pct});
  }
  return result;
}

struct ForceSpan {
  float least_n;
  float mean_n;
  float most_n;
};

// Over the ticks [from, to).
[[nodiscard]] inline ForceSpan force_span(const std::vector<LawLoopTick>& ticks, std::size_t from,
                                          std::size_t to) {
  ForceSpan span{.least_n = ticks[from].force_n, .mean_n = 0.0F, .most_n = ticks[from].force_n};
  for (std::size_t i = from; i < to; ++i) {
    span.least_n = std::min(span.least_n, ticks[i].force_n);
    span.most_n = std::max(span.most_n, ticks[i].force_n);
    span.mean_n += ticks[i].force_n / static_cast<float>(to - from);
  }
  return span;
}

// The milling machine of P1 (the project's corrected sheet, 3.2): 2.2 N/(mm/min) and mm of depth,
// 200 mm/min at 100 %, a cut that settles within the 0.1 s of one revolution, override 0 to 150 %.
[[nodiscard]] inline LawLoopConfig p1_milling(std::uint32_t step_pct) {
  return {.force_reference_n = 800.0F,
          .feed_override = {.period_s = 0.1F,
                            .floor_pct = 0.0F,
                            .ceiling_pct = 150.0F,
                            .step_pct = step_pct,
                            .hysteresis_pct = 0.0F,
                            .slew_up_pct_s = 1e5F,
                            .slew_down_pct_s = 1e5F,
                            .initial_pct = 150.0F},
          .plant = {.period_s = 0.1,
                    .time_constant_s = 0.0,
                    .force_n = 2.2 * 200.0,
                    .feed_exponent = 1.0,
                    .latency_ticks = 0,
                    .override_pct = 150.0}};
}
inline constexpr float kP1MmMinPerPct = 2.0F;

}  // namespace cutforce::host_tests
