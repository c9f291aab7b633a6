// Bad input is refused with its place and a remedy, exit status 2, and no file is left.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

const std::string kMetadata =
    "# pole_pairs: 2\n# rated_power_w: 2200\n# rated_torque_nm: 14.6\n# sample_rate_hz: 1000\n";
const std::string kNames = "t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a,i_w_a\n";

std::string recording(const std::string& names, const std::string& rows,
                      const std::string& metadata = kMetadata) {
  return "# cutforce recording 1\n" + metadata + names + rows;
}
std::string good_rows(int count, int from = 0) {
  std::string rows;
  for (int k = from; k < from + count; ++k) {
    rows += std::to_string(k / 1000) + "." + std::to_string(1000 + k % 1000).substr(1) +
            ",1,2,-3,0.1,0.2,-0.3\n";
  }
  return rows;
}

struct BadRecording {
  std::string name;
  std::string bytes;
  std::string says;
};

// Nothing but the input is in the folder before, and nothing else after.
void expect_refused(const ScratchFolder& folder, const std::string& arguments,
                    const std::string& says) {
  const auto files = folder.file_count();
  const auto result = cutforce(arguments);
  EXPECT_EQ(result.exit_status, 2) << result.output;
  EXPECT_NE(result.output.find(says), std::string::npos) << result.output;
  EXPECT_NE(result.output.find("remedy: "), std::string::npos) << result.output;
  EXPECT_EQ(folder.file_count(), files);
}

TEST(BadRecording, IsRefusedAndLeavesNoTrace) {
  const std::string late = good_rows(3000);
  const std::vector<BadRecording> table{
      {"empty", "", "empty"},
      {"other version", "# cutforce recording 2\n" + kNames + good_rows(9), ":1:"},
      {"no table at all", "\x7f\x45\x4c\x46\x01\x02", ":1:1"},
      {"missing column", recording("t_s,v_un_v,v_vn_v,v_wn_v,i_u_a\n", "0,1,2,3,4\n"), "i_v_a"},
      {"doubled column",
       recording("t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a,i_v_a\n", "0,1,2,3,4,5,6\n"), ":6:"},
      {"both voltages",
       recording("t_s,v_un_v,v_vn_v,v_wn_v,v_uv_v,v_vw_v,v_wu_v,i_u_a,i_v_a\n",
                 "0,1,2,3,4,5,6,7,8\n"),
       ":6:"},
      {"text late", recording(kNames, late + "3.000,1,2,x,4,5,6\n"), ":3007:11"},
      {"NaN late", recording(kNames, late + "3.000,1,2,nan,4,5,6\n"), ":3007:11"},
      {"time back late", recording(kNames, late + "2.000,1,2,3,4,5,6\n"), ":3007:1"},
      {"cell missing", recording(kNames, late + "3.000,1,2,3,4,5\n"), ":3007:"},
      {"endless line", recording(kNames, late + std::string(3 << 20, '7')), ":3007:"},
      {"no rating", recording(kNames, good_rows(9), "# pole_pairs: 2\n"), "rated_power_w"},
      {"pole pairs 0", recording(kNames, good_rows(9), "# pole_pairs: 0\n# rated_power_w: 9\n"),
       ":2:1: pole_pairs"},
      {"negative inertia", recording(kNames, good_rows(9), kMetadata + "# inertia_kg_m2: -1\n"),
       "inertia_kg_m2"},
      {"one row and no rate",
       recording(kNames, good_rows(1), "# pole_pairs: 2\n# rated_power_w: 2200\n"),
       "sample_rate_hz"},
  };
  for (const BadRecording& bad : table) {
    SCOPED_TRACE(bad.name);
    const ScratchFolder folder;
    const auto file = folder.write("bad.csv", bad.bytes);
    expect_refused(folder, "replay " + q(file) + " --report --out " + q(folder.file("out/x.csv")),
                   bad.says);
  }
}

TEST(BadRecording, IsRefusedWhereItsGzipIsCut) {
  const ScratchFolder folder;
  std::string bytes = gzipped(recording(kNames, good_rows(20000)));
  bytes.resize(bytes.size() / 2);
  const auto file = folder.write("cut.csv.gz", bytes);
  expect_refused(folder, "replay " + q(file) + " --out " + q(folder.file("x.csv")), "gzip");
}

TEST(BadRecording, LeavesAnEarlierTraceAsItWas) {
  const ScratchFolder folder;
  const auto file = folder.write("bad.csv", recording(kNames, good_rows(2000) + "2,1,2,x,4,5,6\n"));
  const auto trace = folder.write("x.csv", "precious");
  expect_refused(folder, "replay " + q(file) + " --out " + q(trace), ":2007:");
  EXPECT_EQ(bytes_of(trace), "precious");
}

TEST(BadRecording, IsNotOverwrittenByItsOwnTrace) {
  const ScratchFolder folder;
  const auto text = recording(kNames, good_rows(2000));
  const auto file = folder.write("good.csv", text);
  expect_refused(folder, "replay " + q(file) + " --out " + q(folder.path() / "." / "good.csv"),
                 "take the place");
  EXPECT_EQ(bytes_of(file), text);
}

TEST(BadMachineFile, IsRefusedBeforeAnythingIsWritten) {
  const std::vector<std::pair<std::string, std::string>> table{
      {"[motor\n", ":1:"},
      {"[motor]\npole_pear = 2\n", ":2:1"},
      {"[motor]\nrated_power_kw = 2.2\n", ":2:1"},
      {"[motor]\nrated_power_w = \"2200 W\"\n", ":2:17"},
      {"[motor]\nrated_power_w = 1e9\n", ":2:17"},
      {"[motor]\npole_pairs = 0\n", ":2:14"},
      {"[motor]\ninertia_kg_m2 = -0.1\n", ":2:17"},
      {"[signals]\nsample_rate_hz = 5000\n", "sample_rate_hz = 5000"},
      {"[estimator]\nestimate_period_s = 0.0013\ncontrol_period_s = 0.05\n", "control_period_s"},
  };
  for (const auto& [text, says] : table) {
    SCOPED_TRACE(text);
    const ScratchFolder folder;
    const auto machine = folder.write("machine.toml", text);
    const auto file = folder.write("good.csv", recording(kNames, good_rows(2000)));
    expect_refused(
        folder,
        "replay " + q(file) + " --machine " + q(machine) + " --out " + q(folder.file("x.csv")),
        says);
  }
}

TEST(BadScenario, IsRefusedBeforeAnythingIsWritten) {
  const std::vector<std::pair<std::string, std::string>> table{
      {"preset = \"lathe\"\n", "duration_s"},
      {"duration_s = 1\npreset = \"mill\"\n", ":2:10"},
      {"duration_s = 1\n[process]\ndepth = 3\n", ":3:1"},
      {"duration_s = 1\n[process]\ndepth_mm = 3\n", ":3:1"},
      {"duration_s = 1\n[process]\ndepth_m = [[0, 0], [0.1, 0.001], [0.05, 0]]\n", ":3:"},
      {"duration_s = 1\n[process]\ndepth_m = [[0, 0, 1]]\n", ":3:"},
      {"duration_s = 1\n[process]\ndepth_m = 3\n", ":3:11"},
      {"duration_s = 1\n[motor]\npole_pairs = 2.5\n", ":3:14"},
      {"duration_s = 1\n[feed]\nfeed_m_s = 0.1\nfeed_m_rev = 0.001\n", ":3:12"},
      {"duration_s = 1\n[[faults]]\nkind = \"gap\"\nbegin_s = 2\n", "end_s"},
      {"duration_s = 1\n[[faults]]\nkind = \"gone\"\n", ":3:8"},
      {"duration_s = 1\n[[faults]]\nkind = \"stuck\"\n", "channel"},
      {"duration_s = 1\n[control]\ncontroller = \"best\"\n", ":3:14"},
      {"duration_s = 1\n[sensors.voltage]\nbits = 12\n", "range"},
      {"duration_s = 1\n[believed.motor]\npole_pears = 2\n", ":3:1"},
      {"duration_s = 1e9\n", ":1:14"},
  };
  for (const auto& [text, says] : table) {
    SCOPED_TRACE(text);
    const ScratchFolder folder;
    const auto file = folder.write("scenario.toml", text);
    expect_refused(folder, "simulate " + q(file) + " --out " + q(folder.file("out")), says);
    EXPECT_EQ(cutforce("check " + q(file)).exit_status, 2);
  }
}

TEST(BadOutput, IsRefusedWhereItCannotBe) {
  const ScratchFolder folder;
  const auto file = folder.write("file", "no folder");
  expect_refused(folder, "demo --out " + q(file / "demo"), "cannot be made");
  expect_refused(folder, "replay " + committed("vhz") + " --out " + q(file / "x" / "x.csv"),
                 "cannot be made");
  expect_refused(folder, "convert " + committed("vhz") + " " + q(folder.file("no/x.csv")),
                 "written");
}

TEST(Stopping, LeavesNothingBehind) {
  const ScratchFolder folder;
  const auto scenario = folder.write("long.toml", "duration_s = 30000\n");
  for (const std::string signal : {"INT", "TERM"}) {
    // In the background timeout signals the child and then its group: a second signal means at
    // once.
    const auto result = run_command("timeout --foreground --preserve-status --signal=" + signal +
                                    " 0.5 " + quoted(CUTFORCE_PROGRAM) + " simulate " +
                                    q(scenario) + " --out " + q(folder.file("out")) + " 2>&1");
    EXPECT_EQ(result.exit_status, signal == "INT" ? 130 : 143) << result.output;
    EXPECT_EQ(folder.file_count(), 1U);
  }
}

}  // namespace
}  // namespace cutforce::host_tests
