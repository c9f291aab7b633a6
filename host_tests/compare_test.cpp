// The comparison as a whole: the same figures whatever the threads, all in the tables.
#include "firmware/host/compare/comparison.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "firmware/host/compare/comparison_page.hpp"
#include "firmware/host/compare/comparison_text.hpp"
#include "firmware/host/compare/goals.hpp"
#include "firmware/machine_check.hpp"

namespace cutforce::firmware::host {
namespace {

std::vector<Part> parts_named(const std::vector<std::string>& names) {
  std::vector<Part> parts = comparison_parts();
  std::erase_if(parts,
                [&](const Part& p) { return std::ranges::find(names, p.name) == names.end(); });
  return parts;
}

ComparisonOptions few(unsigned threads) {
  return {.contenders = {find_contender("pi_tuned"), find_contender("pi_zn"),
                         find_contender("oracle_detected")},
          .parts = parts_named({"step1.5", "entry"}),
          .surroundings = Surroundings::kRandom,
          .seeds = 2,
          .robustness = false,
          .traces = true,
          .threads = threads};
}

TEST(Compare, GivesTheSameWhateverTheThreads) {
  const Comparison one = compare(few(1), {});
  const Comparison more = compare(few(3), {});
  EXPECT_EQ(comparison_json(one, {}).dump(), comparison_json(more, {}).dump());
  EXPECT_EQ(comparison_page(one, {}), comparison_page(more, {}));
  EXPECT_EQ(one.cuts, 12U);
  // And the seeds are two: another phase, another machine.
  const auto& seeds = one.find("pi_tuned")->cells[0].seeds;
  EXPECT_NE(seeds[0].impulse_ns, seeds[1].impulse_ns);
}

TEST(Compare, EveryContenderFinishesAndChangesNothingButItsOwn) {
  for (const Contender& contender : contenders()) {
    SCOPED_TRACE(contender.name);
    const Trial trial{};
    const Part part = in_surroundings(parts_named({"step1.5"})[0], Surroundings::kNoise, 1);
    if (!contender.oracle) {
      const Machine machine = machine_of(contender, part, trial);
      EXPECT_TRUE(check(machine)) << check(machine).error();
    }
    const PartMetrics m = cut_part(contender, part, trial);
    EXPECT_TRUE(m.finished);
    EXPECT_GT(m.mean_ratio, 0.8);
    EXPECT_LT(m.mean_ratio, 1.2);
    EXPECT_EQ(find_contender(contender.name), &contender);
  }
  EXPECT_EQ(find_contender("pi_"), nullptr);
}

TEST(Compare, NoControllerBeatsTheOracleOfThePresent) {
  constexpr std::uint64_t kSeeds = 3;
  const Part step4 = parts_named({"step4"})[0];
  const auto impulse_ns = [&](const Contender& contender) {
    double sum_ns = 0.0;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const Part part = in_surroundings(step4, Surroundings::kNoise, seed);
      sum_ns += cut_part(contender, part, {}).impulse_105_ns;
    }
    return sum_ns;
  };
  const double bound_ns = impulse_ns(*find_contender("oracle_present"));
  for (const Contender& contender : contenders()) {
    if (contender.oracle || contender.pass > 1) continue;
    EXPECT_GT(impulse_ns(contender), 0.95 * bound_ns) << contender.name;
  }
}

// The next part goes on with the override that stood last, and the loop with what it has learned.
TEST(Compare, ALaterPassIsTheSameLoopOnTheNextPart) {
  for (const char* name : {"step4", "stairs"}) {
    SCOPED_TRACE(name);
    const Part part = in_surroundings(parts_named({name})[0], Surroundings::kNoise, 2);
    const double first_ns = cut_part(*find_contender("predictive"), part, {}).impulse_105_ns;
    const double second_ns = cut_part(*find_contender("predictive_2"), part, {}).impulse_105_ns;
    EXPECT_GT(first_ns, 20.0);
    EXPECT_LT(second_ns, 0.3 * first_ns);
  }
  // A law that learns nothing of the part gains nothing.
  Contender second = *find_contender("pi_tuned");
  second.pass = 2;
  const Part part = in_surroundings(parts_named({"step4"})[0], Surroundings::kNoise, 2);
  EXPECT_GT(cut_part(second, part, {}).impulse_105_ns, 100.0);
}

TEST(OnThreads, DoesEachPieceOnceAndHandsOnAFailure) {
  std::vector<std::atomic<int>> done(100);
  std::size_t last = 0;
  on_threads(
      100, 3, [&](std::size_t k) { ++done[k]; },
      [&](std::size_t now, std::size_t whole) {
        EXPECT_GE(now, last);
        EXPECT_EQ(whole, 100U);
        last = now;
      });
  EXPECT_TRUE(std::ranges::all_of(done, [](const auto& count) { return count == 1; }));
  const auto fails = [](std::size_t k) {
    if (k == 7) throw std::runtime_error("seven");
  };
  EXPECT_THROW(on_threads(20, 2, fails, {}), std::runtime_error);
  const auto stops = [](std::size_t, std::size_t) { throw std::logic_error("stopped"); };
  EXPECT_THROW(on_threads(
                   20, 2, [](std::size_t) {}, stops),
               std::logic_error);
}

TEST(Swing, IsSustainedOnlyIfLargeAndRepeated) {
  std::vector<double> force_n(600);
  const auto fill = [&](double amplitude_n, double period) {
    for (std::size_t k = 0; k < force_n.size(); ++k) {
      force_n[k] = 500.0 + amplitude_n * std::sin(6.2831853 * static_cast<double>(k) / period);
    }
    return swing_of(force_n, 500.0);
  };
  EXPECT_TRUE(fill(50.0, 60.0).sustained());
  EXPECT_NEAR(fill(50.0, 60.0).spread_ratio, 0.0707, 1e-3);
  EXPECT_FALSE(fill(30.0, 60.0).sustained());    // 4.2 %
  EXPECT_FALSE(fill(90.0, 2400.0).sustained());  // a drift
  EXPECT_FALSE(swing_of({}, 500.0).sustained());
  EXPECT_FALSE(swing_of({900.0, 900.0, 900.0}, 500.0).sustained());  // far off, at rest
}

// P3's dilemma: gains for 1 mm swing at 4 mm. And a late enough machine undoes any of them.
TEST(Robustness, FindsTheLimitsOfAFixedGain) {
  const Contender& nervous = *find_contender("pi_zn");
  const Contender& cautious = *find_contender("pi_cautious");
  EXPECT_TRUE(swing_in(nervous, {.gain_after = 4.0}, {}).sustained());
  EXPECT_FALSE(swing_in(cautious, {.gain_after = 2.0}, {}).sustained());
  EXPECT_TRUE(swing_in(cautious, {.gain_after = 1.5, .latency_s = 0.6}, {}).sustained());
  const Robustness n = robustness_of(nervous, {});
  const Robustness c = robustness_of(cautious, {});
  EXPECT_LT(n.gain_up_ratio, c.gain_up_ratio);
  EXPECT_LT(n.latency_s, c.latency_s);
  EXPECT_LT(c.latency_s, 0.6);
}

TEST(Goals, ConstantFeedTimeIsThatOfTheDeepestPlace) {
  // step4: 27 mm at the 26 % that hold 500 N in 4 mm: 3.33 mm/s at 100 %.
  const double holding = 100.0 * std::pow(500.0 / 1600.0, 1.0 / 0.864);
  EXPECT_NEAR(constant_feed_time_s(parts_named({"step4"}), {}), 27.0 / (holding * 0.0333333), 0.05);
}

TEST(ComparisonText, HoldsEveryContenderPartAndFigure) {
  ComparisonOptions options = few(2);
  options.robustness = true;
  options.seeds = 1;
  const Comparison comparison = compare(options, {});
  const std::vector<Goal> goals = goals_of(comparison, "pi_tuned");
  ASSERT_FALSE(goals.empty());
  const std::string table = comparison_table(comparison, goals);
  const auto json = comparison_json(comparison, goals);
  const std::string page = comparison_page(comparison, goals);
  for (const ComparisonRow& row : comparison.rows) {
    const std::string name(row.contender->name);
    EXPECT_NE(table.find("\n" + name + " "), table.npos) << table;
    EXPECT_NE(page.find(">" + name + "</th>"), page.npos);
    EXPECT_EQ(summary_of(comparison, row).size(), summary_columns().size());
    EXPECT_EQ(row.cells[0].trace.force_n.size(), row.cells[0].trace.override_pct.size());
    EXPECT_NEAR(static_cast<double>(row.cells[0].trace.force_n.size()),
                row.cells[0].seeds[0].time_s / kTraceStep_s, 2.0);
  }
  EXPECT_EQ(json["contenders"].size(), 3U);
  const auto& first = json["contenders"][0];
  EXPECT_EQ(first["parts"].size(), 2U);
  EXPECT_EQ(first["parts"][0]["seeds"].size(), 1U);
  double sum_ns = 0.0;
  for (const auto& part : first["parts"]) sum_ns += part["impulse_105_n_s"].get<double>();
  EXPECT_NEAR(first["total"]["impulse_105_n_s"].get<double>(), sum_ns, 1e-9);
  EXPECT_TRUE(first.contains("robustness"));
  EXPECT_FALSE(json["contenders"][2].contains("robustness"));
  EXPECT_EQ(json["goals"].size(), goals.size());
  EXPECT_EQ(page.find("{{"), page.npos);
  EXPECT_EQ(page.find("http://"), page.npos);
  EXPECT_EQ(page.find("src="), page.npos);
}

}  // namespace
}  // namespace cutforce::firmware::host
