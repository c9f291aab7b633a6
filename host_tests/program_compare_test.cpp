// `cutforce compare` as a person runs it.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

const std::string kFew = "compare --quick --controller pi_tuned oracle_detected --part step1.5 ";

TEST(ProgramCompare, PrintsTablesAndWritesPageAndFigures) {
  const ScratchFolder folder;
  const auto out = folder.file("a/b");
  const auto result = cutforce(kFew + "--out " + q(out));
  ASSERT_EQ(result.exit_status, 0) << result.output;
  EXPECT_NE(result.output.find("pi_tuned"), std::string::npos) << result.output;
  EXPECT_NE(result.output.find("a second"), std::string::npos);
  EXPECT_NE(result.output.find("comparison.html"), std::string::npos);
  EXPECT_NE(bytes_of(out / "comparison.html").find("uPlot"), std::string::npos);
  const auto json = nlohmann::json::parse(bytes_of(out / "comparison.json"));
  EXPECT_EQ(json["contenders"].size(), 2U);
  EXPECT_EQ(json["seeds"], 1);
}

TEST(ProgramCompare, PrintsJsonThatIsTheFileToTheLetter) {
  const ScratchFolder folder;
  const auto file = folder.file("figures.json");
  const auto two = cutforce_output(kFew + "--threads 2 --json");
  const auto one = cutforce_output(kFew + "--threads 1 --json --json-file " + q(file));
  ASSERT_EQ(one.exit_status, 0);
  EXPECT_EQ(one.output, two.output);
  EXPECT_EQ(one.output, bytes_of(file));
  EXPECT_EQ(nlohmann::json::parse(one.output)["surroundings"], "noise");
}

TEST(ProgramCompare, RefusesWhatThereIsNotAndSaysWhatThereIs) {
  const ScratchFolder folder;
  struct Mistake {
    const char* arguments;
    const char* where;
    const char* remedy;
  };
  for (const Mistake& m :
       {Mistake{"--controller pi_tuned magic", "magic", "pi_tuned"},
        Mistake{"--part step5", "step5", "step4"},
        Mistake{"--surroundings rain", "rain", "exact, noise, random"},
        Mistake{"--seeds 0", "--seeds", "from 1 to"},
        Mistake{"--seeds 1000000", "--seeds", "from 1 to"},
        Mistake{"--seeds many", "seeds", "--help"}, Mistake{"--noise", "--noise", "--help"}}) {
    SCOPED_TRACE(m.arguments);
    const auto result = cutforce("compare " + std::string(m.arguments) + " --out " +
                                 q(folder.file("out")) + " --json-file " + q(folder.file("j")));
    EXPECT_EQ(result.exit_status, 2) << result.output;
    EXPECT_NE(result.output.find(m.where), std::string::npos) << result.output;
    EXPECT_NE(result.output.find(m.remedy), std::string::npos) << result.output;
    EXPECT_EQ(folder.file_count(), 0U);
  }
}

TEST(ProgramCompare, LeavesNothingWhereItCannotWrite) {
  const ScratchFolder folder;
  folder.write("file", "a file");
  const auto result = cutforce(kFew + "--out " + q(folder.file("file")));
  EXPECT_EQ(result.exit_status, 2) << result.output;
  EXPECT_NE(result.output.find("remedy"), std::string::npos) << result.output;
  EXPECT_EQ(bytes_of(folder.file("file")), "a file");
  EXPECT_EQ(folder.file_count(), 1U);
}

}  // namespace
}  // namespace cutforce::host_tests
