// Proposals on the simulated machine, by the firmware's own loop, and what is said of them.
#include "firmware/host/design/tuning_run.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware/host/design/tuning.hpp"
#include "firmware/host/machine_file.hpp"

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

// Whatever the plant: every key is one of the table's, and its value within the range there.
TEST(TuningRun, ProposesWhatTheFirmwareTakes) {
  for (const double latency_s : {0.0, 0.3}) {
    for (const double lag_s : {0.0, 0.1}) {
      for (const double settling_s : {0.2, 10.0}) {
        LoopPlant plant = kLathe;
        plant.latency_s = latency_s;
        plant.lag_s = lag_s;
        const Wish wish{.settling_s = settling_s, .period_s = 0.05};
        for (const auto name : tunable_controllers()) {
          for (const auto& proposal : propose(name, plant, wish)) {
            EXPECT_TRUE(tuned_machine(proposal, plant, wish))
                << name << ", " << proposal.rule << ", latency " << latency_s << ", lag " << lag_s
                << ", settling " << settling_s;
          }
        }
      }
    }
  }
}

TEST(TuningRun, SettlesAsWishedAndBearsTwiceTheGain) {
  for (const auto name : tunable_controllers()) {
    for (const auto& proposal : propose(name, kLathe, kWish)) {
      if (proposal.rule.starts_with("Ziegler")) continue;
      SCOPED_TRACE(proposal.controller + ", " + proposal.rule);
      const auto machine = tuned_machine(proposal, kLathe, kWish);
      ASSERT_TRUE(machine);
      const auto run = tuning_run(*machine, kLathe, kWish, 1.0);
      EXPECT_LT(run.approach.overshoot_ratio, 0.05);
      EXPECT_GT(run.deeper.overshoot_ratio, 0.2);  // nobody sees it coming
      EXPECT_LT(run.deeper.overshoot_ratio, 0.5);
      // mrac is bound by what its adaptation bears; tune() says so.
      EXPECT_LE(run.approach.settling_s, name == "mrac" ? 2.0 : kWish.settling_s);
      EXPECT_GE(settles_up_to(*machine, kLathe, kWish), 1.5);
    }
  }
}

TEST(TuningRun, SaysWhereTheOverrideIsAtItsEnd) {
  const auto proposal = propose("pi", kLathe, kWish).front();
  const auto machine = tuned_machine(proposal, kLathe, kWish);
  ASSERT_TRUE(machine);
  const auto run = tuning_run(*machine, kLathe, kWish, 0.25);
  EXPECT_GT(run.rest_pct, kRunCeilingPct);
  EXPECT_DOUBLE_EQ(run.override_pct.back(), kRunCeilingPct);
}

// An exponent of 1 makes the linear loop exact around rest, but for rounding to 1 %.
TEST(TuningRun, RingsWhereTheLinearLoopSaysSo) {
  LoopPlant plant = kLathe;
  plant.exponent = 1.0;
  auto proposal = propose("pi", plant, kWish).front();
  const double limit = proposal.linear.at(0).margins.gain_ratio;
  const auto machine = tuned_machine(proposal, plant, kWish);
  ASSERT_TRUE(machine);
  EXPECT_TRUE(std::isfinite(tuning_run(*machine, plant, kWish, 0.6 * limit).approach.settling_s));
  EXPECT_FALSE(std::isfinite(tuning_run(*machine, plant, kWish, 1.3 * limit).approach.settling_s));
}

TEST(Tuning, SaysWhatAMachineFileReadsBack) {
  const auto all = tunable_controllers();
  const auto tuning = tune(kLathe, kWish, {}, {all.begin(), all.end()});
  for (const auto& tried : tuning.proposals) {
    SCOPED_TRACE(tried.proposal.controller);
    const auto file = parse_machine_text(toml_snippet(tried.proposal, tuning), "snippet");
    EXPECT_TRUE(file.errors.empty()) << (file.errors.empty() ? "" : file.errors[0].text());
    EXPECT_EQ(file.machine.force_reference_n, 500.0F);
    for (const auto& setting : tried.proposal.settings) EXPECT_TRUE(file.is_given(setting.key));
    EXPECT_EQ(tried.runs.size(), 3U);
  }
  const auto json = tuning_json(tuning);
  EXPECT_EQ(json["proposals"].size(), tuning.proposals.size());
  EXPECT_EQ(json["proposals"][0]["controller"], "pi");
}

TEST(Tuning, WarnsOfAMachineThatCannotCarryTheForce) {
  LoopPlant plant = kLathe;
  plant.gain_n_pct = 1.0;
  const auto tuning = tune(plant, {.settling_s = 1.0, .period_s = 0.4}, {}, {"pi"});
  ASSERT_EQ(tuning.warnings.size(), 2U);
  EXPECT_NE(tuning.warnings[0].find("control period"), std::string::npos);
  EXPECT_NE(tuning.warnings[1].find("outside 20..200 %"), std::string::npos);
}

}  // namespace
}  // namespace cutforce::host_tests
