// A machine without its motor, described by a scenario: through the whole program.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "firmware/host/scenario/scenario.hpp"
#include "hal/host/recording_reader.hpp"
#include "hal/host/simulation/force_machine_port.hpp"
#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

using firmware::EstimatorName;
using firmware::host::Model;
using firmware::host::parse_scenario;
using hal::host::ForceMachine;
using hal::host::ForceMachinePort;
using nlohmann::json;

const std::string kNoisy =
    "model = \"force\"\nduration_s = 8\n[sensor]\nnoise_ratio = 0.02\nnoise_n = 4\n"
    "noise_correlation_s = 0.03\n[control]\ncontroller = \"pi\"\nforce_reference_n = 500\n";

// The overrides that were sent, of a trace.
std::vector<std::string> overrides(const std::string& trace) {
  std::istringstream lines(trace);
  std::vector<std::string> found;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('#') || line.starts_with("t_s")) continue;
    std::istringstream cells(line);
    std::string cell;
    for (int k = 0; k < 11; ++k) std::getline(cells, cell, ',');
    found.push_back(cell);
  }
  return found;
}

TEST(ForceScenario, GivesTheFirmwareADynamometerAndOneSampleAControlPeriod) {
  const auto scenario = parse_scenario(
      "model = \"force\"\nduration_s = 3\n[estimator]\ncontrol_period_s = 0.1\n"
      "[control]\noverride_initial_pct = 150\n",
      "a");
  ASSERT_TRUE(scenario) << scenario.error().front().text();
  EXPECT_EQ(scenario->model, Model::kForce);
  EXPECT_EQ(scenario->machine.estimator, EstimatorName::kDynamometer);
  EXPECT_EQ(scenario->machine.sample_rate_hz, 10.0F);
  EXPECT_DOUBLE_EQ(scenario->force.sample_s, 0.1);
  EXPECT_DOUBLE_EQ(scenario->force.feed.initial_override_pct, 150.0);
  EXPECT_TRUE(scenario->warnings.empty()) << scenario->warnings.front();
  const auto own = parse_scenario(
      "model = \"force\"\nduration_s = 3\n[feed]\ninitial_override_pct = 70\nfeed_m_rev = 1e-4\n",
      "b");
  ASSERT_TRUE(own) << own.error().front().text();
  EXPECT_DOUBLE_EQ(own->force.feed.initial_override_pct, 70.0);
  EXPECT_DOUBLE_EQ(own->force.feed.feed_m_s, 0.0);
}

// 400 N a mm at 100 %, exponent 1: the answer in closed form, at every depth.
TEST(ForceScenario, HasTheForceThatItsKeysSay) {
  const auto scenario = parse_scenario(
      "model = \"force\"\nduration_s = 5\nstarts_in_cut = true\n[process]\nexponent = 1\n"
      "depth_m = [[0, 0.002], [0.004, 0.002], [0.004, 0.001]]\n[feed]\ninitial_override_pct = 50\n"
      "[sensor]\nlag_s = 0\ngain_ratio = 1.1\n",
      "a");
  ASSERT_TRUE(scenario) << scenario.error().front().text();
  auto machine = ForceMachine::make(scenario->force).value();
  ForceMachinePort port(machine, scenario->duration_s);
  hal::Sample sample{};
  int samples = 0;
  while (port.read(std::span(&sample, 1)).value() == 1) {
    ++samples;
    const auto truth = port.truth();
    EXPECT_EQ(sample.time_ns, truth.time_ns);
    EXPECT_NEAR(static_cast<double>(sample.measured_force_n), 1.1 * truth.cutting_force_n, 1e-3);
    if (truth.depth_m > 1.5e-3) {
      EXPECT_NEAR(truth.cutting_force_n, 400.0, 1e-9);
    }
  }
  EXPECT_EQ(samples, 101);  // every 50 ms from 0 to 5 s
  EXPECT_NEAR(port.truth().cutting_force_n, 200.0, 1e-6);
}

// A command is on the wire before the machine moves: one sent at a tick acts over the next period.
TEST(ForceMachinePort, ClosesTheLoopWithinOnePeriod) {
  auto scenario = parse_scenario(
      "model = \"force\"\nduration_s = 5\nstarts_in_cut = true\n[process]\nexponent = 1\nlag_s = "
      "0\n"
      "depth_m = 0.001\n[feed]\nlatency_s = 0\nscan_s = 0\nlag_s = 0\n[sensor]\nlag_s = 0\n",
      "a");
  ASSERT_TRUE(scenario) << scenario.error().front().text();
  auto machine = ForceMachine::make(scenario->force).value();
  int steps = 0;
  ForceMachinePort port(machine, scenario->duration_s, [&steps](const ForceMachine&) { ++steps; });
  hal::Sample sample{};
  ASSERT_EQ(port.read(std::span(&sample, 1)).value(), 1U);
  EXPECT_EQ(steps, 0);
  EXPECT_NEAR(sample.measured_force_n, 400.0F, 1e-3F);
  ASSERT_TRUE(
      port.write({.time_ns = 0, .override_pct = 150, .override_code = 150, .controlling = true}));
  ASSERT_EQ(port.read(std::span(&sample, 1)).value(), 1U);
  EXPECT_EQ(steps, 25);
  EXPECT_NEAR(sample.measured_force_n, 600.0F, 1e-3F);
  EXPECT_EQ(sample.override_applied_pct, 150.0F);
  EXPECT_EQ(port.read({}).value(), 0U);
}

TEST(ForceScenario, WritesTheSameFilesForTheSameSeed) {
  const ScratchFolder folder;
  const auto scenario = folder.write("a.toml", "seed = 7\n" + kNoisy);
  const auto other = folder.write("b.toml", "seed = 8\n" + kNoisy);
  for (const auto& [file, name] : {std::pair{scenario, "1"}, {scenario, "2"}, {other, "3"}}) {
    const auto result = cutforce("simulate " + q(file) + " --out " + q(folder.file(name)));
    EXPECT_EQ(result.exit_status, 0) << result.output;
  }
  for (const std::string name :
       {"recording.csv.gz", "trace.csv", "machine.toml", "summary.json", "report.html"}) {
    EXPECT_FALSE(bytes_of(folder.file("1/" + name)).empty()) << name;
    EXPECT_EQ(bytes_of(folder.file("1/" + name)), bytes_of(folder.file("2/" + name))) << name;
  }
  EXPECT_NE(bytes_of(folder.file("1/trace.csv")), bytes_of(folder.file("3/trace.csv")));
}

TEST(ForceScenario, RecordsWhatReplaysToTheSameTrace) {
  const ScratchFolder folder;
  const auto run = folder.file("run");
  const auto scenario = folder.write("a.toml", kNoisy);
  ASSERT_EQ(cutforce("simulate " + q(scenario) + " --out " + q(run)).exit_status, 0);
  const auto again = folder.file("again.csv");
  const auto replayed =
      cutforce("replay " + q(run / "recording.csv.gz") + " --machine " + q(run / "machine.toml") +
               " --estimator dynamometer --out " + q(again));
  ASSERT_EQ(replayed.exit_status, 0) << replayed.output;
  EXPECT_EQ(bytes_of(run / "trace.csv"), bytes_of(again));
  EXPECT_EQ(overrides(bytes_of(again)).size(), 161U);
}

// The same forces by another way in: an outside plant that asks the loop tick by tick.
TEST(ForceScenario, GivesTheSameOverridesInLockstep) {
  const ScratchFolder folder;
  const auto run = folder.file("run");
  const auto scenario = folder.write("a.toml", kNoisy);
  ASSERT_EQ(cutforce("simulate " + q(scenario) + " --out " + q(run)).exit_status, 0);
  auto reader = hal::host::RecordingReader::open(run / "recording.csv.gz");
  ASSERT_TRUE(reader) << reader.error().text();
  std::string lines;
  hal::Sample sample{};
  while (reader->read(std::span(&sample, 1)).value() == 1) {
    EXPECT_EQ(sample.present,
              hal::bit(hal::Signal::kMeasuredForce) | hal::bit(hal::Signal::kOverrideApplied));
    lines += json{{"t_s", static_cast<double>(sample.time_ns) * 1e-9},
                  {"measured_force_n", static_cast<double>(sample.measured_force_n)},
                  {"override_pct", static_cast<double>(sample.override_applied_pct)}}
                 .dump() +
             "\n";
  }
  const auto input = folder.write("lines.json", lines);
  const auto answered =
      cutforce_output("lockstep --machine " + q(run / "machine.toml") + " < " + q(input));
  ASSERT_EQ(answered.exit_status, 0) << answered.output;
  const auto sent = overrides(bytes_of(run / "trace.csv"));
  std::istringstream answers(answered.output);
  std::size_t k = 0;
  for (std::string line; std::getline(answers, line); ++k) {
    ASSERT_LT(k, sent.size());
    EXPECT_EQ(json::parse(line).at("override_pct").get<double>(), std::stod(sent[k])) << k;
  }
  EXPECT_EQ(k, sent.size());
}

TEST(ForceScenario, HasATemplateThatPassesItsOwnCheck) {
  const ScratchFolder folder;
  const auto text = cutforce("simulate --template=force").output;
  const auto file = folder.write("a.toml", text);
  EXPECT_EQ(cutforce("check " + q(file)).output, file.string() + ": ok, a scenario\n");
  EXPECT_EQ(cutforce("simulate --template=lathe").exit_status, 2);
  // The template's values are those of a file that gives nothing.
  const auto given = parse_scenario(text, "a");
  const auto bare = parse_scenario("model = \"force\"\nduration_s = 11\n", "b");
  ASSERT_TRUE(given && bare);
  EXPECT_EQ(given->machine, bare->machine);
  EXPECT_EQ(given->force.step_s, bare->force.step_s);
  EXPECT_FLOAT_EQ(static_cast<float>(given->force.feed.feed_m_s),
                  static_cast<float>(bare->force.feed.feed_m_s));
  EXPECT_EQ(given->force.process.exponent, bare->force.process.exponent);
  EXPECT_EQ(given->force.process.depth_m.points().size(),
            bare->force.process.depth_m.points().size());
}

TEST(ForceScenario, IsRefusedWithPlaceAndRemedyBeforeAnythingIsWritten) {
  const std::string head = "model = \"force\"\nduration_s = 3\n";
  const std::vector<std::pair<std::string, std::string>> table{
      {head + "step = 0.001\n", ":3:1: step does not name its unit"},
      {head + "sample_rate_hz = 1000\n", ":3:1: sample_rate_hz does not belong"},
      {head + "[motor]\npole_pairs = 2\n", ":3:2: unknown section motor"},
      {head + "[sensors.speed]\nnoise_rad_s = 2\n", ":3:2: unknown section sensors"},
      {head + "[believed.signals]\nsample_rate_hz = 100\n", ":4:18: there is one force"},
      {head + "[process]\ndiameter_m = 0.05\n", ":4:1: unknown key diameter_m"},
      {head + "[process]\nlag_s = -0.1\n", ":4:9: lag_s = -0.1"},
      {head + "[sensor]\nlag_s = nan\n", ":4:9: lag_s is not a finite number"},
      {head + "[sensor]\nmean_s = inf\n", ":4:10: mean_s"},
      {head + "[spindle]\nprogrammed_speed_1_s = 0\n", ":4:24"},
      {head + "[feed]\nfeed_m_s = 0.1\nfeed_m_rev = 0.001\n", ":4:12"},
      {head + "step_s = 0.003\n", ":3:10: step_s does not divide the control period"},
      {head + "[estimator]\ncontrol_period_s = 0.0333\n", "step_s does not divide"},
      {head + "[estimator]\nestimator = \"fused\"\n", ":4:13: a machine without its motor"},
      {head + "[estimator]\nestimate_period_s = 0.01\n", ":4:21: there is one force"},
      {head + "[control]\noverride_floor_pct = 210\n", ":4:22: override_floor_pct = 210"},
      {head + "[control]\ncut_drop_ratio = 0\n", ":4:18: cut_drop_ratio = 0"},
      {head + "[[process.hard_spots]]\nbegin_m = 2\nend_m = 1\nfactor = 2\n",
       "ends before it begins"},
      {"model = \"force\"\npreset = \"motor_a\"\nduration_s = 3\n", ":2:10"},
      {"model = \"forces\"\nduration_s = 3\n", ":1:9"},
      {"model = \"force\"\n", "duration_s"},
  };
  for (const auto& [text, says] : table) {
    SCOPED_TRACE(text);
    const ScratchFolder folder;
    const auto file = folder.write("scenario.toml", text);
    for (const std::string& command :
         {std::string("check "), "simulate --out " + q(folder.file("out")) + " "}) {
      const auto result = cutforce(command + q(file));
      EXPECT_EQ(result.exit_status, 2) << result.output;
      EXPECT_NE(result.output.find(says), std::string::npos) << result.output;
      EXPECT_NE(result.output.find("remedy: "), std::string::npos) << result.output;
      EXPECT_EQ(folder.file_count(), 1U);
    }
  }
}

TEST(ForceScenario, HasNoOtherEstimatorsToCompare) {
  const ScratchFolder folder;
  const auto file = folder.write("a.toml", kNoisy);
  const auto result = cutforce("simulate " + q(file) + " --compare --out " + q(folder.file("out")));
  EXPECT_EQ(result.exit_status, 2);
  EXPECT_NE(result.output.find("--compare"), std::string::npos) << result.output;
  EXPECT_EQ(folder.file_count(), 1U);
}

}  // namespace
}  // namespace cutforce::host_tests
