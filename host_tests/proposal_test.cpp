// Gains from a plant and a wish.
#include "firmware/host/design/proposal.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

namespace cutforce::host_tests {
namespace {

using namespace firmware::host;

// "ZOH + 1 sample": k = 4 N/%, tau = 0.1 s, T = 0.05 s.
constexpr LoopPlant kLathe{.gain_n_pct = 4.0,
                           .exponent = 1.0,
                           .lag_s = 0.1,
                           .latency_s = 0.05,
                           .feed_lag_s = 0.0,
                           .sensor_lag_s = 0.0,
                           .reference_n = 500.0};

double value_of(const Proposal& proposal, const std::string& key) {
  for (const auto& setting : proposal.settings) {
    if (setting.key == key) return std::stod(setting.value);
  }
  ADD_FAILURE() << "no " << key;
  return 0.0;
}

const Proposal& by_rule(const std::vector<Proposal>& all, const std::string& rule) {
  return *std::ranges::find_if(all, [&](const auto& p) { return p.rule.starts_with(rule); });
}

TEST(Proposal, IsZieglerAndNicholsForThePapersLathe) {
  const auto limit = ultimate(kLathe.discrete(0.05));
  EXPECT_NEAR(limit.gain * 4.0, 2.54, 0.005);
  EXPECT_NEAR(limit.period_s, 0.249, 0.001);
  const auto all = propose("pi", kLathe, {.settling_s = 0.6, .period_s = 0.05});
  const auto& found = by_rule(all, "Ziegler");
  EXPECT_NEAR(value_of(found, "pi_proportional_pct_n"), 0.286, 0.0006);
  EXPECT_NEAR(value_of(found, "pi_integral_pct_n_s"), 1.38, 0.006);
}

// An integral on a dead time of one tick: L = g/(z(z-1)). |L| = 1 at 2 sin(w/2) = g, and the
// gain may grow to 1 (P1's Jury conditions).
TEST(Proposal, HasTheMarginsOfAnIntegralOnADeadTime) {
  LoopPlant plant = kLathe;
  plant.lag_s = 0.0;
  plant.latency_s = 0.1;
  const auto all = propose("variable_gain", plant, {.settling_s = 2.0, .period_s = 0.1});
  ASSERT_EQ(all.size(), 1U);
  const double g = value_of(all[0], "variable_gain_open_loop_1_s") * 0.1;
  const auto& loop = all[0].linear.at(0);
  EXPECT_NEAR(loop.margins.gain_ratio, 1.0 / g, 1e-6 / g);
  EXPECT_NEAR(loop.highest_gain_n_pct, 4.0 / g, 1e-6);
  const double crossing = 2.0 * std::asin(0.5 * g);
  const double phase = std::numbers::pi / 2 - 1.5 * crossing;
  EXPECT_NEAR(loop.margins.phase_rad, phase, 1e-6);
  EXPECT_NEAR(loop.margins.delay_s, phase / crossing * 0.1, 1e-6);
}

// Both ways to the largest gain agree: where the locus cuts the axis, and Schur and Cohn.
TEST(Proposal, SettlesAsWishedAndKeepsItsMargins) {
  for (const double latency_s : {0.0, 0.035, 0.12}) {
    for (const double lag_s : {0.0, 0.1, 0.3}) {
      LoopPlant plant = kLathe;
      plant.latency_s = latency_s;
      plant.lag_s = lag_s;
      plant.feed_lag_s = 0.03;
      for (const std::string name : {"pi", "pid", "pole_assignment", "variable_gain", "fuzzy"}) {
        SCOPED_TRACE(name + " " + std::to_string(latency_s) + " " + std::to_string(lag_s));
        const Wish wish{.settling_s = 1.5, .period_s = 0.05};
        const auto all = propose(name, plant, wish);
        ASSERT_FALSE(all.empty());
        for (const auto& proposal : all) {
          const auto& loop = proposal.linear.at(0);
          EXPECT_TRUE(loop.margins.stable);
          EXPECT_NEAR(loop.highest_gain_n_pct / 4.0, loop.margins.gain_ratio,
                      1e-6 * loop.margins.gain_ratio);
          if (proposal.rule.starts_with("Ziegler")) continue;
          EXPECT_GE(loop.margins.gain_ratio, 2.0);
          EXPECT_GE(loop.margins.modulus_ratio, 0.5);
          EXPECT_EQ(proposal.wish_met, loop.step.settling_s <= wish.settling_s);
          if (proposal.wish_met) {
            // Not faster than was asked for by much: calm is what is cheap.
            EXPECT_GT(loop.step.settling_s, 0.5 * wish.settling_s);
          } else {
            EXPECT_NE(proposal.warnings.at(0).find("cannot be had"), std::string::npos);
          }
        }
      }
    }
  }
}

TEST(Proposal, SaysWhatCanBeHadWhereTheWishCannot) {
  for (const auto name : tunable_controllers()) {
    SCOPED_TRACE(name);
    LoopPlant plant = kLathe;
    plant.latency_s = 0.3;
    const auto all = propose(name, plant, {.settling_s = 0.2, .period_s = 0.05});
    ASSERT_FALSE(all.empty());
    for (const auto& proposal : all) {
      EXPECT_FALSE(proposal.wish_met);
      for (const auto& loop : proposal.linear) {
        EXPECT_GE(loop.step.settling_s, 0.3);
        EXPECT_LT(loop.step.settling_s, 6.0);
      }
    }
    EXPECT_NE(all[0].warnings.at(0).find("cannot be had"), std::string::npos);
  }
}

// y = 1 - a^i for the plant (1 - a)/(z - a), and nothing before the dead time.
TEST(StepResponse, IsThePlantsOwn) {
  const auto y = step_response({0.2}, {1.0, -0.8, 0.0}, 50);
  EXPECT_EQ(y[0], 0.0);
  EXPECT_EQ(y[1], 0.0);
  for (std::size_t i = 1; i < y.size(); ++i)
    EXPECT_NEAR(y[i], 1.0 - std::pow(0.8, static_cast<double>(i) - 1.0), 1e-12);
}

}  // namespace
}  // namespace cutforce::host_tests
