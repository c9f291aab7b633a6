#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

TEST(Program, HasHelpWithExamplesForEachCommand) {
  const auto all = cutforce("--help");
  EXPECT_EQ(all.exit_status, 0);
  for (const std::string command : {"demo", "simulate", "replay", "evaluate", "check", "report",
                                    "lockstep", "reproduce", "compare", "tune", "convert"}) {
    SCOPED_TRACE(command);
    EXPECT_NE(all.output.find("\n  " + command + " "), std::string::npos) << all.output;
    const auto one = cutforce(command + " --help");
    EXPECT_EQ(one.exit_status, 0);
    EXPECT_NE(one.output.find("Examples:\n  cutforce " + command), std::string::npos) << one.output;
  }
}

TEST(Program, RefusesACommandLineThatIsWrong) {
  for (const std::string line :
       {"", "replya", "--nothing", "replay", "replay x.csv", "replay --out x", "demo --out",
        "convert one", "report", "evaluate --condition nonsense", "evaluate --estimator nonsense",
        "replay x.csv --out y.csv --rate -5", "replay x.csv --out y.csv --rate many", "check",
        "simulate", "lockstep", "demo --unknown", "reproduce --figure p1_fig13"}) {
    const auto result = cutforce(line);
    EXPECT_EQ(result.exit_status, 2) << line << "\n" << result.output;
    EXPECT_NE(result.output.find("remedy: "), std::string::npos) << line << "\n" << result.output;
  }
}

TEST(Program, GuessesTheCommandThatWasMeant) {
  EXPECT_NE(cutforce("replya").output.find("perhaps replay is meant"), std::string::npos);
}

TEST(Program, FailsWhereItsOutputCannotBeWritten) {
  EXPECT_EQ(cutforce("check --template > /dev/full").exit_status, 1);
}

TEST(Program, WritesTemplatesThatPassItsOwnCheck) {
  const ScratchFolder folder;
  const auto machine = folder.write("machine.toml", cutforce("check --template").output);
  const auto scenario = folder.write("scenario.toml", cutforce("simulate --template").output);
  const auto demo = folder.write("demo.toml", cutforce("demo --scenario").output);
  EXPECT_EQ(cutforce("check " + q(machine)).output, machine.string() + ": ok, a machine file\n");
  EXPECT_EQ(cutforce("check " + q(scenario)).output, scenario.string() + ": ok, a scenario\n");
  EXPECT_EQ(cutforce("check " + q(demo)).exit_status, 0);
}

TEST(Program, ChecksEveryScenarioOfTheTree) {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(in_tests("scenarios"))) {
    if (entry.is_directory()) continue;
    const auto result = cutforce("check " + q(entry.path()));
    EXPECT_EQ(result.exit_status, 0) << result.output;
    ++count;
  }
  EXPECT_GE(count, 6U);
}

TEST(Program, NamesEveryMistakeOfAMachineFileWithItsPlace) {
  const ScratchFolder folder;
  const auto file = folder.write("bad.toml",
                                 "[motor]\npole_pairs = 0\nrated_power_kw = 5.5\n"
                                 "rated_torque_nm = 35\ninertia_kg_m2 = -1\n");
  const auto result = cutforce("check " + q(file));
  EXPECT_EQ(result.exit_status, 2);
  for (const std::string text : {":2:14: pole_pairs = 0", ":3:1: ", "rated_power_w", ":5:17: "}) {
    EXPECT_NE(result.output.find(text), std::string::npos) << text << "\n" << result.output;
  }
  const auto json = nlohmann::json::parse(cutforce_output("check --json " + q(file)).output);
  EXPECT_FALSE(json.at("ok").get<bool>());
  EXPECT_EQ(json.at("kind"), "machine");
  EXPECT_EQ(json.at("errors").size(), 3U);
}

TEST(Program, SaysWhatItDerivedFromTheRating) {
  const ScratchFolder folder;
  const auto file = folder.write("plate.toml",
                                 "[motor]\npole_pairs = 2\nrated_power_w = 2200\n"
                                 "rated_torque_nm = 14.6\n");
  const auto result = cutforce("check " + q(file));
  EXPECT_EQ(result.exit_status, 0);
  EXPECT_NE(result.output.find("stator_resistance_ohm is not given"), std::string::npos)
      << result.output;
}

}  // namespace
}  // namespace cutforce::host_tests
