// States, transitions and reasons as the documentation has them.
#include "control/supervisor_text.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <set>
#include <string>

#include "control/supervisor_table.hpp"
#include "support/supervisor_bench.hpp"

namespace cutforce::control {
namespace {

using S = SupervisorState;

TEST(SupervisorText, NamesEachStateAndReasonOnceInAWholeSentence) {
  std::set<std::string_view> names;
  for (const StateText& text : kStateTexts) {
    EXPECT_TRUE(names.insert(text.name).second) << text.name;
    EXPECT_TRUE(text.sentence.ends_with('.')) << text.name;
  }
  names.clear();
  for (const ReasonText& text : kReasonTexts) {
    EXPECT_TRUE(names.insert(text.name).second) << text.name;
    EXPECT_TRUE(text.sentence.ends_with('.') && text.remedy.ends_with('.')) << text.name;
  }
}

// Each reason but the first is given by some row, so that none is explained in vain.
TEST(SupervisorText, ExplainsOnlyReasonsThatAreGiven) {
  std::set<Reason> given;
  for (const Transition& row : kTransitions) given.insert(row.reason);
  EXPECT_EQ(given.size(), kReasonCount);
}

std::string states_of(StateSet states) {
  std::string text;
  for (unsigned k = 0; k < kSupervisorStateCount; ++k) {
    if ((states >> k & 1U) == 0) continue;
    text += (text.empty() ? "" : ", ") + std::string(kStateTexts[k].name);
  }
  return text;
}

std::string events_of(EventSet events) {
  std::string text;
  for (unsigned k = 0; k < kEventCount; ++k) {
    if ((events >> k & 1U) == 0) continue;
    text += (text.empty() ? "" : " + ") + std::string(kEventNames[k]);
  }
  return text.empty() ? "always" : text;
}

const char* yes(bool holds) { return holds ? "yes" : "-"; }

std::string tables() {
  std::string text =
      "### States\n\n| no. | state | meaning | controller | may rise | alive | alarm |\n"
      "|---:|---|---|---|---|---|---|\n";
  for (unsigned k = 0; k < kSupervisorStateCount; ++k) {
    host_tests::SupervisorBench bench;
    const S state = bench.lead_to(static_cast<S>(k));
    const auto& out = bench.output;
    text += "| " + std::to_string(k) + " | `" + std::string(text_of(state).name) + "` | " +
            std::string(text_of(state).sentence) + " | " + yes(out.permission.enable) + " | " +
            yes(out.permission.may_rise) + " | " + yes(out.alive) + " | " + yes(out.alarm) + " |\n";
  }
  text +=
      "\n### Transitions, the first that fits\n\n| from | on | to | reason |\n|---|---|---|---|\n";
  for (const Transition& row : kTransitions) {
    text += "| " + states_of(row.states) + " | " + events_of(row.events) + " | " +
            std::string(text_of(row.next).name) + " | " + std::string(text_of(row.reason).name) +
            " |\n";
  }
  text += "\n### Reasons\n\n| no. | reason | meaning | remedy |\n|---:|---|---|---|\n";
  for (unsigned k = 0; k < kReasonCount; ++k) {
    const ReasonText& reason = kReasonTexts[k];
    text += "| " + std::to_string(k) + " | `" + std::string(reason.name) + "` | " +
            std::string(reason.sentence) + " | " + std::string(reason.remedy) + " |\n";
  }
  return text;
}

// CUTFORCE_WRITE_TABLES=1 cutforce_tests --gtest_filter='SupervisorText.*' writes them anew.
TEST(SupervisorText, IsWhatTheDocumentationShows) {
  const std::string path = CUTFORCE_SOURCE_DIR "/control/SUPERVISOR.md";
  constexpr std::string_view kMark = "<!-- the rest is written by supervisor_text_test -->\n\n";
  std::ifstream file(path);
  ASSERT_TRUE(file) << path;
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const auto mark = text.find(kMark);
  ASSERT_NE(mark, std::string::npos);
  const std::string prose = text.substr(0, mark + kMark.size());
  if (std::getenv("CUTFORCE_WRITE_TABLES") != nullptr) {
    std::ofstream(path) << prose << tables();
  } else {
    EXPECT_TRUE(text == prose + tables()) << "SUPERVISOR.md differs from the code; rewrite it "
                                             "with CUTFORCE_WRITE_TABLES=1 and read the diff";
  }
}

}  // namespace
}  // namespace cutforce::control
