// (C104): how many times the gain that the law works with the true one may be.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include "support/predictive_lathe.hpp"

namespace cutforce::control {
namespace {

// Largest |x| over the last quarter over the largest of the first, of z - e + c (1 + (r-1) e^d
// z^-d).
double growth(double e, double c, double r, int d, int ticks) {
  std::vector<double> x(static_cast<std::size_t>(d) + 1, 1.0);  // newest last
  double early = 0.0;
  double late = 0.0;
  for (int i = 0; i < ticks; ++i) {
    const double next = (e - c) * x.back() - c * (r - 1.0) * std::pow(e, d) * x.front();
    x.erase(x.begin());
    x.push_back(next);
    if (i < ticks / 4) early = std::max(early, std::abs(next));
    if (i >= ticks - ticks / 4) late = std::max(late, std::abs(next));
  }
  return late / early;
}

double bound(double e, double c, int d) {
  return 1.0 + (1.0 - std::abs(e - c)) / (c * std::pow(e, d));
}

TEST(PredictiveStability, TheBoundIsSufficientForEveryDeadTimeAndHorizon) {
  for (const double lag_s : {0.05, 0.1, 0.3}) {
    for (const double horizon_s : {0.05, 0.1, 0.2, 0.4, 1.0}) {
      for (int d = 0; d <= 8; ++d) {
        SCOPED_TRACE(testing::Message() << lag_s << ' ' << horizon_s << ' ' << d);
        const double e = std::exp(-0.05 / lag_s);
        const double e_h = std::exp(-horizon_s / lag_s);
        const double c = (1.0 - e) * e_h / (1.0 - e_h);
        const double most = bound(e, c, d);
        if (most > 1e6) continue;
        EXPECT_LT(growth(e, c, 1.0 + 0.98 * (most - 1.0), d, 4000), 1.0);
        if (horizon_s < 0.06) {  // one tick: c = e, and the bound is exact
          EXPECT_NEAR(c, e, 1e-12);
          EXPECT_GT(growth(e, c, 1.0 + 1.02 * (most - 1.0), d, 4000), 1.0);
        }
      }
    }
  }
}

// What the law publishes in a steady cut is this bound at its calm horizon.
TEST(PredictiveStability, IsPublished) {
  for (const int d : {0, 1, 2, 4, 8}) {
    for (const float horizon_s : {0.1F, 0.2F, 0.4F}) {
      auto config = host_tests::kPredictiveLathe;
      config.latency_s = 0.05F * static_cast<float>(d);
      config.feed_lag_s = 0.0F;
      config.calm_horizon_s = horizon_s;
      auto law = Predictive::make(config).value();
      LawOutput answer{};
      for (int i = 0; i < 400; ++i) {
        answer = law.step({.force_reference_n = 500.0F,
                           .force_n = 500.0F,
                           .force_sigma_n = 0.0F,
                           .override_applied_pct = 130.0F,
                           .override_tolerance_pct = 0.5F,
                           .spindle_ratio = 1.0F,
                           .phase = CutPhase::kCut,
                           .mode = LawMode::kTrack,
                           .part_start = false});
      }
      const double e = std::exp(-0.5);
      const double e_h = std::exp(-static_cast<double>(horizon_s) / 0.1);
      const double expected = bound(e, (1.0 - e) * e_h / (1.0 - e_h), d);
      EXPECT_NEAR(answer.stability_margin_ratio, expected, 0.02 * expected)
          << d << ' ' << horizon_s;
      EXPECT_GT(answer.stability_margin_ratio, 1.6F);
    }
  }
}

}  // namespace
}  // namespace cutforce::control
