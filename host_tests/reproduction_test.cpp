// The papers' figures, run again: every number of the project's corrected sheet that concerns
// control, each bounded on both sides, and the page and program around them.
#include "firmware/host/reproduce/reproduction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "firmware/host/reproduce/paper_scenarios.hpp"
#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

using firmware::host::Check;
using firmware::host::Finding;
using firmware::host::Outcome;
using firmware::host::Reproduction;

// Once for all tests: it runs everything.
const Reproduction& reproduction() {
  static const Reproduction all = [] {
    auto made = firmware::host::reproduce("");
    if (!made) throw std::runtime_error(made.error().front().text());
    return std::move(*made);
  }();
  return all;
}

std::vector<const Finding*> findings() {
  std::vector<const Finding*> all;
  for (const Finding& finding : reproduction().equations) all.push_back(&finding);
  for (const auto& figure : reproduction().figures) {
    for (const Finding& finding : figure.findings) all.push_back(&finding);
  }
  return all;
}

const Check& check(const std::string& name) {
  for (const Finding* finding : findings()) {
    for (const Check& one : finding->checks) {
      if (one.name == name) return one;
    }
  }
  throw std::runtime_error("there is no check " + name);
}

TEST(Reproduction, EveryNumberThatMustComeOutDoes) {
  std::size_t count = 0;
  for (const Finding* finding : findings()) {
    for (const Check& one : finding->checks) {
      EXPECT_TRUE(one.holds()) << one.name << ": " << one.value << ", not within " << one.least
                               << " to " << one.most;
      EXPECT_TRUE(std::isfinite(one.least) && std::isfinite(one.most)) << one.name;
      ++count;
    }
  }
  EXPECT_GE(count, 75U);
  EXPECT_TRUE(reproduction().holds());
}

// The numbers themselves, so that no bound of the program's can be moved unseen.
TEST(Reproduction, FindsTheNumbersOfTheCorrectedSheet) {
  EXPECT_NEAR(check("P1: critical gain of the fixed-gain loop, N/(mm/min)").value, 5.7143, 1e-3);
  EXPECT_LT(check("P1: poles through (14) and (8), worst error").value, 1e-9);
  EXPECT_NEAR(check("P1: allowed gain ratio, case I").value, 2.326, 1e-3);
  EXPECT_NEAR(check("P1: allowed gain ratio, case II").value, 1.282, 1e-3);
  EXPECT_NEAR(check("P1: allowed gain ratio, case III").value, 2.000, 1e-3);
  EXPECT_EQ(check("P1 Fig. 8: override at 1 mm, %").value, 150.0);
  EXPECT_NEAR(check("P1 Fig. 8: force at 1 mm, N").value, 660.0, 1.0);
  EXPECT_NEAR(check("P1 Fig. 8: mean force at 2 mm, N").value, 800.0, 8.0);
  EXPECT_NEAR(check("P1 Fig. 8: spike at 2 mm, N").value, 1320.0, 1.0);
  EXPECT_NEAR(check("P1 Fig. 8: highest force at 3 mm, N").value, 1980.0, 1.0);
  EXPECT_GE(check("P1 Fig. 10: swings after the entry, case II").value, 4.0);
  EXPECT_EQ(check("P1 Fig. 9: swings after the entry, case I").value, 1.0);
  EXPECT_EQ(check("P1 Fig. 11: swings after the entry, case III").value, 1.0);
  EXPECT_NEAR(check("P2: alpha_1 of the sampled plant").value, -0.988701, 1e-6);
  EXPECT_NEAR(check("P2: beta_1").value, 0.522168, 1e-6);
  EXPECT_NEAR(check("P2: plant (34), A(1,2)").value, -2.5621, 1e-4);
  EXPECT_NEAR(check("P2: model (35), A_m(2,2)").value, 0.9909, 1e-4);
  EXPECT_NEAR(check("P2: P(1,1) of the discrete equation").value, 2.24978, 1e-3);
  EXPECT_NEAR(check("P2: ultimate gain at 20 ms").value, 4.999, 1e-3);
  EXPECT_NEAR(check("P2: largest pole of the printed PID at 20 ms (unstable)").value, 23.4, 0.05);
  EXPECT_NEAR(check("P2: largest pole of the printed PID at 1 ms (stable)").value, 0.957, 1e-3);
  EXPECT_NEAR(check("P2 Fig. 9: 5 % settling of the MRAC, s").value, 1.7, 0.1);
  EXPECT_LE(check("P2 Fig. 9: peak of the MRAC over the reference").value, 1.0);
  EXPECT_LE(check("P3 Fig. 6: mean error at rest, %").value, 3.0);
  EXPECT_LE(check("P3 Fig. 8: mean error at rest, %").value, 3.0);
}

TEST(Reproduction, SaysWhyWhereAStatementDoesNotComeOut) {
  std::size_t differing = 0;
  for (const Finding* finding : findings()) {
    EXPECT_FALSE(finding->said.empty() || finding->got.empty());
    if (finding->outcome != Outcome::kDiffers) continue;
    EXPECT_FALSE(finding->reason.empty()) << finding->said;
    ++differing;
  }
  EXPECT_GE(differing, 6U);
  EXPECT_LE(differing, 10U);
}

TEST(Reproduction, CarriesEveryScenarioOfTheFolderAndUsesEach) {
  std::set<std::string> used;
  for (const auto& judged : reproduction().figures) {
    for (const auto& run : judged.figure.runs) used.emplace(run.scenario);
  }
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(in_tests("scenarios/papers"))) {
    const std::string name = entry.path().stem().string();
    const auto found = std::ranges::find(firmware::host::paper_scenarios(), name,
                                         &firmware::host::PaperScenario::name);
    ASSERT_NE(found, firmware::host::paper_scenarios().end()) << name;
    EXPECT_EQ(found->text, bytes_of(entry.path())) << name;
    EXPECT_TRUE(used.contains(name)) << name;
    ++files;
  }
  EXPECT_EQ(files, firmware::host::paper_scenarios().size());
}

TEST(Reproduction, RunsAFigureAsSimulateDoes) {
  const ScratchFolder folder;
  const auto run = folder.file("run");
  const auto scenario = in_tests("scenarios/papers/p1_fig09.toml");
  ASSERT_EQ(cutforce("simulate " + q(scenario) + " --out " + q(run)).exit_status, 0);
  const auto& memory = reproduction().runs.at("p1_fig09");
  std::istringstream lines(bytes_of(run / "trace.csv"));
  std::size_t k = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('#') || line.starts_with("t_s")) continue;
    ASSERT_LT(k, memory.tick_s.size());
    EXPECT_NE(line.find("," + std::to_string(static_cast<int>(memory.override_pct[k])) + ","),
              std::string::npos)
        << line;
    ++k;
  }
  EXPECT_EQ(k, memory.tick_s.size());
}

TEST(Reproduction, WritesOnePageThatPointsNowhere) {
  const ScratchFolder folder;
  const auto result = cutforce("reproduce --figure p1_fig10 --out " + q(folder.file("out")));
  EXPECT_EQ(result.exit_status, 0) << result.output;
  const std::string page = bytes_of(folder.file("out/reproduction.html"));
  EXPECT_NE(page.find("<section id=\"p1_fig10\">"), std::string::npos);
  for (const std::string outside : {"src=\"", "href=\"http", "@import", "url(http", "{{"}) {
    EXPECT_EQ(page.find(outside), std::string::npos) << outside;
  }
  EXPECT_EQ(page, [&] {
    (void)cutforce("reproduce --figure p1_fig10 --out " + q(folder.file("again")));
    return bytes_of(folder.file("again/reproduction.html"));
  }()) << "not the same twice";
}

TEST(Reproduction, TellsProgramsWhatItTellsPeople) {
  const ScratchFolder folder;
  const auto result =
      cutforce_output("reproduce --json --figure p2_fig09 --out " + q(folder.file("out")));
  ASSERT_EQ(result.exit_status, 0);
  const auto json = nlohmann::json::parse(result.output);
  EXPECT_TRUE(json.at("holds").get<bool>());
  ASSERT_EQ(json.at("figures").size(), 1U);
  EXPECT_EQ(json.at("figures")[0].at("name"), "p2_fig09");
  EXPECT_EQ(json.at("figures")[0].at("scenarios").size(), 4U);
  EXPECT_TRUE(json.at("equations").empty());
}

TEST(Reproduction, RefusesAFigureThatThereIsNot) {
  const ScratchFolder folder;
  const auto result = cutforce("reproduce --figure p1_fig8 --out " + q(folder.file("out")));
  EXPECT_EQ(result.exit_status, 2);
  EXPECT_NE(result.output.find("perhaps p1_fig08"), std::string::npos) << result.output;
  EXPECT_EQ(folder.file_count(), 0U);
}

}  // namespace
}  // namespace cutforce::host_tests
