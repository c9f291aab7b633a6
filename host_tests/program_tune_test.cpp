// cutforce tune as a person runs it.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

// 4 N a per cent, dead time 0.1 s, no lag, a force that is no round number.
std::string step_test() {
  std::string text = "# cutforce recording 1\nt_s,override_pct,measured_force_n\n";
  const auto level = [](int k) { return k / 40 % 2 == 0 ? 100 : 130; };
  for (int k = 0; k < 400; ++k) {
    const double force_n = 4.0 * level(k < 2 ? 0 : k - 2) + 2.0 * std::sin(3.0 * k);
    text += std::to_string(0.05 * k) + "," + std::to_string(level(k)) + "," +
            std::to_string(force_n) + "\n";
  }
  return text;
}

TEST(TuneProgram, WritesAPageThatNeedsNothingElse) {
  ScratchFolder folder;
  const auto recording = folder.write("steps.csv", step_test());
  const auto page = folder.file("tuning.html");
  const auto result = cutforce("tune " + recording.string() +
                               " --controller all --settling 1 --out " + page.string());
  EXPECT_EQ(result.exit_status, 0) << result.output;
  EXPECT_NE(result.output.find("pi_proportional_pct_n = "), std::string::npos);
  const auto html = bytes_of(page);
  EXPECT_EQ(html.find("{{"), std::string::npos);
  EXPECT_EQ(html.find("src=\""), std::string::npos);
  EXPECT_EQ(html.find("<link"), std::string::npos);
  for (const char* id : {"\"fit\"", "\"steps\"", "\"p0f\"", "\"p0u\""})
    EXPECT_NE(html.find("id=" + std::string(id)), std::string::npos) << id;
}

TEST(TuneProgram, RefusesWithPlaceAndRemedyAndLeavesNothing) {
  ScratchFolder folder;
  const auto recording = folder.write("steps.csv", step_test()).string();
  struct Case {
    std::string arguments;
    std::string says;
  };
  const std::string plant = "--gain 4 --lag 0.1 --latency 0.05 ";
  const std::vector<Case> table{
      {"", "the plant is not known"},
      {"--gain 4 --lag 0.1", "the plant is not known"},
      {"--gain nan --lag 0.1 --latency 0.05", "--gain: this is not a number"},
      {"--gain -4 --lag 0.1 --latency 0.05", "the force rises with the feed"},
      {"--gain 0 --lag 0.1 --latency 0.05", "--gain"},
      {"--gain inf --lag 0.1 --latency 0.05", "--gain"},
      {"--gain 4 --lag -1 --latency 0.05", "--lag"},
      {"--gain 4 --lag 0.1 --latency nan", "--latency"},
      {plant + "--settling 0", "--settling"},
      {plant + "--period nan", "--period"},
      {plant + "--controller nonsense", "there is none named nonsense"},
      {recording + " --gain 4", "given twice"},
      {recording + " --from 3 --to 2", "--from"},
      {recording + " --from 2.2 --to 3.8", "there is no step"},
      {folder.file("none.csv").string(), "cannot be opened"},
  };
  const auto files = folder.file_count();
  for (const auto& [arguments, says] : table) {
    const auto result =
        cutforce("tune " + arguments + " --out " + folder.file("page.html").string());
    EXPECT_EQ(result.exit_status, 2) << arguments << "\n" << result.output;
    EXPECT_NE(result.output.find(says), std::string::npos) << arguments << "\n" << result.output;
    EXPECT_NE(result.output.find("remedy: "), std::string::npos) << arguments;
    EXPECT_EQ(folder.file_count(), files) << arguments;
  }
}

}  // namespace
}  // namespace cutforce::host_tests
