#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "firmware/host/trace_reader.hpp"
#include "hal/host/recording_reader.hpp"
#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

using firmware::LoopOutput;
using nlohmann::json;

std::vector<LoopOutput> read_trace(const std::filesystem::path& path) {
  auto reader = firmware::host::TraceReader::open(path);
  EXPECT_TRUE(reader) << reader.error().text();
  std::vector<LoopOutput> rows;
  std::array<LoopOutput, 256> block{};
  for (std::size_t count = 1; reader && count > 0;) {
    count = reader->read(block).value();
    rows.insert(rows.end(), block.begin(), block.begin() + static_cast<std::ptrdiff_t>(count));
  }
  return rows;
}

double figure(const json& summary, const std::string& key) {
  for (const auto& entry : summary.at("figures")) {
    if (entry.at("key") == key) return entry.at("value").get<double>();
  }
  return std::nan("");
}

TEST(Replay, FindsTheForceOfTheCommittedRecording) {
  const ScratchFolder folder;
  const auto trace = folder.file("trace.csv");
  const auto result =
      cutforce_output("replay " + committed("entry_cut") + " --json --out " + q(trace));
  ASSERT_EQ(result.exit_status, 0) << result.output;
  const json summary = json::parse(result.output);
  EXPECT_EQ(figure(summary, "samples"), 15001.0);
  const auto rows = read_trace(trace);
  ASSERT_EQ(rows.size(), 60U);  // one each control tick of 50 ms
  EXPECT_EQ(figure(summary, "trace_rows"), 60.0);
  // 200 N at 1 mm, 300 N at 1.5 mm: entry_cut.toml.
  for (const LoopOutput& row : rows) {
    const double time_s = static_cast<double>(row.time_ns) * 1e-9;
    const bool first = time_s > 1.75 && time_s < 1.95;
    const bool second = time_s > 2.2 && time_s < 2.4;
    if (!first && !second) continue;
    EXPECT_EQ(row.state, firmware::LoopState::kCut);
    EXPECT_NEAR(row.cutting_force_n, first ? 200.0F : 300.0F, 3.0F) << time_s;
  }
}

TEST(Replay, WritesAsManyRowsAsAreAskedFor) {
  const ScratchFolder folder;
  const std::vector<std::pair<std::string, std::size_t>> table{
      {"20", 60}, {"100", 300}, {"1000", 3000}, {"2500", 7500}, {"5000", 15000}};
  for (const auto& [rate, rows] : table) {
    SCOPED_TRACE(rate);
    const auto trace = folder.file(rate + ".csv");
    const auto result =
        cutforce("replay " + committed("entry_cut") + " --rate " + rate + " --out " + q(trace));
    ASSERT_EQ(result.exit_status, 0) << result.output;
    EXPECT_EQ(read_trace(trace).size(), rows);
  }
  const auto wrong =
      cutforce("replay " + committed("entry_cut") + " --rate 700 --out " + q(folder.file("x.csv")));
  EXPECT_EQ(wrong.exit_status, 2);
  EXPECT_NE(wrong.output.find("divided by a whole number"), std::string::npos) << wrong.output;
}

TEST(Replay, RunsEveryEstimatorOnEveryCommittedRecording) {
  const ScratchFolder folder;
  for (const std::string recording : {"entry_cut", "air_cut", "two_currents_line_to_line", "vhz"}) {
    for (const std::string estimator : {"measured", "computed", "synthesized", "fused"}) {
      SCOPED_TRACE(recording + " " + estimator);
      const auto trace = folder.file("trace.csv");
      const auto result = cutforce_output("replay " + committed(recording) + " --estimator " +
                                          estimator + " --json --out " + q(trace));
      ASSERT_EQ(result.exit_status, 0) << result.output;
      EXPECT_GT(figure(json::parse(result.output), "with_torque_pct"), 50.0);
    }
  }
}

TEST(Replay, WritesAReportOnlyWhereItIsAsked) {
  const ScratchFolder folder;
  const auto trace = folder.file("run/trace.csv");
  EXPECT_EQ(cutforce("replay " + committed("vhz") + " --out " + q(trace)).exit_status, 0);
  EXPECT_FALSE(std::filesystem::exists(folder.file("run/summary.json")));
  // A trace alone is enough for a report.
  EXPECT_EQ(cutforce("report " + q(folder.file("run"))).exit_status, 0);
  EXPECT_GT(std::filesystem::file_size(folder.file("run/report.html")), 50'000U);
  EXPECT_EQ(cutforce("replay " + committed("vhz") + " --report --out " + q(trace)).exit_status, 0);
  const json summary = json::parse(bytes_of(folder.file("run/summary.json")));
  EXPECT_EQ(summary.at("traces").at(0).at("name"), "fused");
  EXPECT_TRUE(
      std::filesystem::exists(folder.file("run") / summary.at("recording").get<std::string>()));
}

TEST(Replay, FitsItsPeriodsToASlowRecording) {
  const ScratchFolder folder;
  std::string text =
      "# cutforce recording 1\n# pole_pairs: 2\n# rated_power_w: 2200\n# rated_torque_nm: 14.6\n"
      "t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a,i_w_a\n";
  for (int k = 0; k < 1000; ++k) text += std::to_string(0.004 * k) + ",0,0,0,0,0,0\n";
  const auto file = folder.write("slow.csv", text);
  const auto result = cutforce("replay " + q(file) + " --out " + q(folder.file("x.csv")));
  EXPECT_EQ(result.exit_status, 0) << result.output;
  for (const std::string key : {"estimate_period_s", "control_period_s"}) {
    EXPECT_NE(result.output.find("warning: " + key), std::string::npos) << result.output;
  }
  EXPECT_NE(result.output.find("There was no estimate"), std::string::npos) << result.output;
}

// Raw samples of a switching inverter carry no torque; the firmware says so and gives no number.
TEST(Replay, RefusesRawPwmByName) {
  const ScratchFolder folder;
  std::string text = bytes_of(in_tests("scenarios/pwm.toml"));
  text.replace(text.find("anti_alias_hz = 1500"), 20, "anti_alias_hz = 0");
  text.replace(text.find("sample_rate_hz = 20000"), 22, "sample_rate_hz = 5000");
  const auto scenario = folder.write("raw.toml", text);
  const auto recording = folder.file("raw.csv.gz");
  ASSERT_EQ(cutforce("simulate " + q(scenario) + " --recording " + q(recording)).exit_status, 0);
  const auto trace = folder.file("trace.csv");
  const auto result = cutforce_output("replay " + q(recording) + " --json --out " + q(trace));
  EXPECT_EQ(result.exit_status, 1);
  const json summary = json::parse(result.output);
  EXPECT_NE(summary.at("verdict").get<std::string>().find("raw_pwm"), std::string::npos);
  const auto rows = read_trace(trace);
  ASSERT_FALSE(rows.empty());
  EXPECT_EQ(rows.back().state, firmware::LoopState::kRefused);
  EXPECT_TRUE(rows.back().faults.contains(estimator::Fault::kRawPwm));
  for (const LoopOutput& row : rows) EXPECT_EQ(row.present & LoopOutput::kCuttingTorque, 0U);
}

TEST(Replay, NamesTheFaultsOfASoundButBadRecording) {
  const ScratchFolder folder;
  const std::string head = bytes_of(in_tests("scenarios/vhz.toml"));
  const std::vector<std::pair<std::string, std::string>> table{
      {"kind = \"gap\"\nbegin_s = 1.8\nend_s = 2\n", "fault_gap"},
      {"kind = \"stuck\"\nchannel = \"current_u\"\nbegin_s = 1.8\n", "fault_stuck_channel"},
      {"kind = \"lost\"\nchannel = \"current_v\"\nbegin_s = 1.8\n", "fault_lost_phase"},
      {"kind = \"swapped\"\nchannel = \"voltage_u\"\nother = \"voltage_v\"\n", "fault_phase_order"},
  };
  for (const auto& [fault, key] : table) {
    SCOPED_TRACE(key);
    const auto scenario = folder.write("bad.toml", head + "\n[[faults]]\n" + fault);
    const auto recording = folder.file("bad.csv.gz");
    ASSERT_EQ(cutforce("simulate " + q(scenario) + " --recording " + q(recording)).exit_status, 0);
    const auto trace = folder.file("trace.csv");
    const auto result = cutforce_output("replay " + q(recording) + " --json --out " + q(trace));
    ASSERT_NE(result.exit_status, 2);
    EXPECT_GT(figure(json::parse(result.output), key), 0.0) << result.output;
    estimator::FaultSet named{};
    for (const LoopOutput& row : read_trace(trace)) named = named | row.faults;
    EXPECT_FALSE(named.empty());
  }
}

// The text of one sample for the lockstep dialogue.
std::string line_of(const hal::Sample& sample) {
  json line{{"t_s", static_cast<double>(sample.time_ns) * 1e-9}};
  const std::array<const char*, 3> voltages{"v_un_v", "v_vn_v", "v_wn_v"};
  const std::array<const char*, 3> currents{"i_u_a", "i_v_a", "i_w_a"};
  for (std::size_t k = 0; k < 3; ++k) {
    line[voltages[k]] = static_cast<double>(sample.voltage_v[k]);
    line[currents[k]] = static_cast<double>(sample.current_a[k]);
  }
  line["speed_rad_s"] = static_cast<double>(sample.speed_rad_s);
  line["power_meter_w"] = static_cast<double>(sample.power_meter_w);
  return line.dump() + "\n";
}

TEST(Lockstep, GivesTheVeryRowsThatReplayGives) {
  const ScratchFolder folder;
  auto reader = hal::host::RecordingReader::open(in_tests("recordings/vhz.csv.gz")).value();
  std::string input;
  std::array<hal::Sample, 512> block{};
  for (std::size_t count = 1; count > 0;) {
    count = reader.read(block).value();
    for (std::size_t k = 0; k < count; ++k) input += line_of(block[k]);
  }
  std::string machine = "[motor]\n";
  std::string friction = "[friction]\n";
  for (const auto& entry : reader.metadata()) {
    const bool of_friction = entry.key == "coulomb_torque_nm" || entry.key == "viscous_nm_s_rad";
    if (entry.key == "load_friction_ratio") friction += entry.key + " = [" + entry.value + "]\n";
    if (of_friction) friction += entry.key + " = " + entry.value + "\n";
    if (entry.key.starts_with("rated_") || entry.key.ends_with("_ohm") ||
        entry.key.ends_with("_h") || entry.key == "pole_pairs" || entry.key == "inertia_kg_m2") {
      machine += entry.key + " = " + entry.value + "\n";
    }
  }
  std::string meter;
  for (const auto& entry : reader.metadata()) {
    if (entry.key.starts_with("meter_")) meter += entry.key + " = " + entry.value + "\n";
  }
  const auto file = folder.write("machine.toml", machine + friction + "[power_meter]\n" + meter);
  const auto lines = folder.write("lines", input);
  const auto trace = folder.file("trace.csv");
  ASSERT_EQ(cutforce("replay " + committed("vhz") + " --machine " + q(file) + " --out " + q(trace))
                .exit_status,
            0);
  const auto answers =
      cutforce_output("lockstep --sample-rate 1000 --machine " + q(file) + " < " + q(lines));
  ASSERT_EQ(answers.exit_status, 0) << answers.output;

  std::vector<json> ticks;
  std::size_t answered = 0;
  std::istringstream stream(answers.output);
  for (std::string text; std::getline(stream, text); ++answered) {
    json answer = json::parse(text);
    if (!answer.at("t_s").is_null() && (ticks.empty() || ticks.back() != answer)) {
      ticks.push_back(std::move(answer));
    }
  }
  EXPECT_EQ(answered, 3001U);  // one answer for each line
  const auto rows = read_trace(trace);
  ASSERT_EQ(ticks.size(), rows.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    EXPECT_NEAR(ticks[k].at("t_s").get<double>(), static_cast<double>(rows[k].time_ns) * 1e-9,
                1e-9);
    const bool known = (rows[k].present & LoopOutput::kCuttingTorque) != 0;
    ASSERT_EQ(ticks[k].at("cutting_torque_nm").is_number(), known) << k;
    if (!known) continue;
    EXPECT_EQ(ticks[k].at("cutting_torque_nm").get<float>(), rows[k].cutting_torque_nm) << k;
    EXPECT_EQ(ticks[k].at("cutting_torque_sigma_nm").get<float>(), rows[k].cutting_torque_sigma_nm);
    EXPECT_EQ(ticks[k].at("airgap_torque_nm").get<float>(), rows[k].airgap_torque_nm);
  }
}

TEST(Convert, ComesBackAsItWas) {
  const ScratchFolder folder;
  const auto binary = folder.file("x.cfr");
  const auto again = folder.file("x.csv");
  ASSERT_EQ(cutforce("convert " + committed("vhz") + " " + q(binary)).exit_status, 0);
  ASSERT_EQ(cutforce("convert " + q(binary) + " " + q(again)).exit_status, 0);
  const auto original = run_command("gzip -dc " + committed("vhz"));
  EXPECT_EQ(bytes_of(again), original.output);
}

}  // namespace
}  // namespace cutforce::host_tests
