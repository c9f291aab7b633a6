// Proposals on the simulated machine, by the firmware's own loop.
#include "firmware/host/design/tuning_run.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace cutforce::host_tests {
namespace {

using namespace firmware::host;

constexpr LoopPlant kLathe{.gain_n_pct = 4.0,
                           .exponent = 0.864,
                           .lag_s = 0.1,
                           .latency_s = 0.035,
                           .feed_lag_s = 0.03,
                           .sensor_lag_s = 0.03,
                           .reference_n = 500.0};
constexpr Wish kWish{.settling_s = 1.0, .period_s = 0.05};

TEST(TuningRun, X) {
  for (auto name : tunable_controllers()) for (auto& p : propose(name, kLathe, kWish)) {
    auto m = tuned_machine(p, kLathe, kWish);
    printf("%s %s machine %d\n", p.controller.c_str(), p.rule.c_str(), m.has_value());
    for (auto& s : p.settings) printf("  %s = %s\n", s.key.c_str(), s.value.c_str());
    for (auto& w : p.warnings) printf("  ! %s\n", w.c_str());
    if (!p.linear.empty()) printf("  lin settle %g os %g highest %g\n", p.linear[0].step.settling_s, p.linear[0].step.overshoot_ratio, p.linear[0].highest_gain_n_pct);
    if (!m) continue;
    for (double r : {0.5, 1.0, 2.0}) {
      auto run = tuning_run(*m, kLathe, kWish, r);
      printf("  r %g approach %g %g deeper %g %g\n", r, run.approach.overshoot_ratio, run.approach.settling_s, run.deeper.overshoot_ratio, run.deeper.settling_s);
    }
    printf("  up to %g\n", settles_up_to(*m, kLathe, kWish));
  }
}

}  // namespace
}  // namespace cutforce::host_tests
