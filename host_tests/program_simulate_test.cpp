#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "firmware/host/scenario/scenario.hpp"
#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

using nlohmann::json;

const std::string kShort =
    "duration_s = 2.2\nsample_rate_hz = 1000\n[sensors.voltage]\nnoise_v = 1\n"
    "[process]\ndepth_m = [[0, 0], [0.001, 0], [0.001, 0.001]]\n"
    "[control]\ncontroller = \"pi\"\nforce_reference_n = 300\n";

TEST(Simulate, WritesTheSameFilesForTheSameSeed) {
  const ScratchFolder folder;
  const auto scenario = folder.write("a.toml", "seed = 7\n" + kShort);
  const auto other = folder.write("b.toml", "seed = 8\n" + kShort);
  const auto make = [&](const std::filesystem::path& file, const std::string& name) {
    const auto result =
        cutforce("simulate " + q(file) + " --compare --out " + q(folder.file(name)));
    EXPECT_EQ(result.exit_status, 0) << result.output;
  };
  make(scenario, "first");
  make(scenario, "second");
  make(other, "third");
  for (const std::string name :
       {"recording.csv.gz", "trace.csv", "trace_computed.csv", "trace_synthesized.csv",
        "trace_measured.csv", "machine.toml", "summary.json", "report.html"}) {
    SCOPED_TRACE(name);
    const std::string first = bytes_of(folder.file("first") / name);
    EXPECT_FALSE(first.empty());
    EXPECT_EQ(first, bytes_of(folder.file("second") / name));
  }
  EXPECT_NE(bytes_of(folder.file("first/trace.csv")), bytes_of(folder.file("third/trace.csv")));
}

// What the loop saw live is what a replay of the recording sees: one text, two ports.
TEST(Simulate, RecordsWhatReplaysToTheSameTrace) {
  const ScratchFolder folder;
  const auto scenario = folder.write("a.toml", kShort);
  const auto run = folder.file("run");
  ASSERT_EQ(cutforce("simulate " + q(scenario) + " --out " + q(run)).exit_status, 0);
  const auto again = folder.file("again.csv");
  const auto replayed = cutforce("replay " + q(run / "recording.csv.gz") + " --machine " +
                                 q(run / "machine.toml") + " --rate 1000 --out " + q(again));
  ASSERT_EQ(replayed.exit_status, 0) << replayed.output;
  EXPECT_EQ(bytes_of(run / "trace.csv"), bytes_of(again));
}

TEST(Simulate, MakesTheCommittedRecordings) {
  const ScratchFolder folder;
  for (const std::string name : {"entry_cut", "air_cut", "two_currents_line_to_line", "vhz"}) {
    SCOPED_TRACE(name);
    const auto made = folder.file(name + ".csv");
    const auto result = cutforce("simulate " + q(in_tests("scenarios/" + name + ".toml")) +
                                 " --recording " + q(made));
    ASSERT_EQ(result.exit_status, 0) << result.output;
    EXPECT_EQ(bytes_of(made), run_command("gzip -dc " + committed(name)).output)
        << "toolchain/make_recordings.sh makes them anew";
  }
}

TEST(Simulate, HasTheDemoAmongItsScenarios) {
  EXPECT_EQ(bytes_of(in_tests("scenarios/demo_step.toml")), firmware::host::demo_scenario_text());
}

// What a person believes of the machine need not be so.
TEST(Simulate, TellsTheFirmwareWhatThePersonBelieves) {
  const auto scenario = firmware::host::parse_scenario(
      "duration_s = 1\n[motor]\nstator_resistance_ohm = 0.3\n[believed.motor]\ninertia_kg_m2 = "
      "0.2\n[estimator]\nestimator = \"computed\"\n",
      "test");
  ASSERT_TRUE(scenario) << scenario.error().front().text();
  EXPECT_FLOAT_EQ(scenario->machine.stator_resistance_ohm, 0.9F);  // in a phase of the delta
  EXPECT_FLOAT_EQ(scenario->machine.inertia_kg_m2, 0.2F);
  EXPECT_DOUBLE_EQ(scenario->simulation.spindle.inertia_kg_m2, 0.12);
  EXPECT_EQ(scenario->machine.estimator, firmware::EstimatorName::kComputed);
}

TEST(Simulate, ReadsEveryKeyOfItsTemplateBack) {
  for (const auto preset : {firmware::host::Preset::kLathe, firmware::host::Preset::kMotorA,
                            firmware::host::Preset::kMotorB}) {
    const std::string text = firmware::host::scenario_template(preset);
    const auto scenario = firmware::host::parse_scenario(text, "template");
    ASSERT_TRUE(scenario) << scenario.error().front().text();
    EXPECT_EQ(scenario->machine,
              firmware::host::machine_of(firmware::host::simulation_of(preset), preset));
  }
}

TEST(Evaluate, ReadsTheCommittedRecordings) {
  const auto result = cutforce_output("evaluate --json --quick " + q(in_tests("recordings")));
  ASSERT_EQ(result.exit_status, 0);
  const json figures = json::parse(result.output);
  EXPECT_FALSE(figures.empty());
  const ScratchFolder empty;
  EXPECT_EQ(cutforce("evaluate " + q(empty.path())).exit_status, 2);
}

}  // namespace
}  // namespace cutforce::host_tests
