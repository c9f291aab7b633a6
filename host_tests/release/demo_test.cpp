// The main job, as anybody first meets it.
#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <string>

#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

double figure(const nlohmann::json& summary, const std::string& key) {
  for (const auto& entry : summary.at("figures")) {
    if (entry.at("key") == key) return entry.at("value").get<double>();
  }
  ADD_FAILURE() << "no figure " << key;
  return 0.0;
}

TEST(Demo, HoldsTheForceAndShowsIt) {
  const ScratchFolder folder;
  const auto began = std::chrono::steady_clock::now();
  const auto result = cutforce_output("demo --json --out " + q(folder.file("demo")));
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
  ASSERT_EQ(result.exit_status, 0) << result.output;
  EXPECT_LT(took.count(), 20.0);
  for (const std::string name : {"recording.csv.gz", "trace.csv", "machine.toml", "summary.json",
                                 "report.html", "trace_computed.csv"}) {
    EXPECT_TRUE(std::filesystem::exists(folder.file("demo") / name)) << name;
  }
  EXPECT_EQ(cutforce("check " + q(folder.file("demo/machine.toml"))).exit_status, 0);

  const auto summary = nlohmann::json::parse(result.output);
  std::string names;
  for (const auto& trace : summary.at("traces")) names += trace.at("name").get<std::string>() + " ";
  EXPECT_EQ(names, "fused computed synthesized measured ");
  for (const std::string depth : {"depth_1_mm_", "depth_1.5_mm_"}) {
    SCOPED_TRACE(depth);
    EXPECT_NEAR(figure(summary, depth + "force_n"), 500.0, 5.0);
    EXPECT_LT(figure(summary, depth + "force_sd_n"), 10.0);
    EXPECT_LT(figure(summary, depth + "settling_s"), 2.0);
  }
  // Without control the step would end at 600 N times the override before it, 126 %.
  EXPECT_LT(figure(summary, "depth_1.5_mm_peak_n"), 700.0);
  EXPECT_GE(figure(summary, "coverage_pct"), 95.0);
  EXPECT_LT(figure(summary, "error_rms_pct"), 1.0);
  EXPECT_NEAR(figure(summary, "estimate_lag_ms"), 1.5, 4.5);
}

}  // namespace
}  // namespace cutforce::host_tests
