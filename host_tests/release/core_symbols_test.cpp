// The gate that the build applies to the core's archives, shown to refuse what it is there for.
#include <gtest/gtest.h>

#include <string>

#include "support/run_command.hpp"

namespace cutforce::host_tests {
namespace {

CommandResult gate(const std::string& archives) {
  return run_command(quoted(CUTFORCE_SOURCE_DIR "/toolchain/check_core_symbols.sh") + " " +
                     quoted(CUTFORCE_NM) + archives + " 2>&1");
}

CommandResult gate_planted(const std::string& violation) {
  return gate(" " + quoted(CUTFORCE_PLANTED_DIR "/libcutforce_planted_" + violation + ".a"));
}

void expect_refused(const std::string& violation, const std::string& symbol) {
  const auto result = gate_planted(violation);
  EXPECT_EQ(result.exit_status, 1) << result.output;
  EXPECT_NE(result.output.find("  " + symbol + ":"), std::string::npos) << result.output;
}

TEST(CoreSymbols, OfTheEstimatorNeedNobodyElse) {
  const auto result = gate(" " + quoted(CUTFORCE_ESTIMATOR_ARCHIVE));
  EXPECT_EQ(result.exit_status, 0) << result.output;
}

TEST(CoreSymbols, OfTheControllersNeedNobodyElse) {
  const auto result = gate(" " + quoted(CUTFORCE_CONTROL_ARCHIVE));
  EXPECT_EQ(result.exit_status, 0) << result.output;
}

TEST(CoreSymbols, OfTheBusNeedNobodyElse) {
  const auto result = gate(" " + quoted(CUTFORCE_CAN_ARCHIVE));
  EXPECT_EQ(result.exit_status, 0) << result.output;
}

TEST(CoreSymbols, OfTheLoopNeedOnlyTheEstimatorTheControllersAndTheBus) {
  const auto result =
      gate(" " + quoted(CUTFORCE_FIRMWARE_ARCHIVE) + " " + quoted(CUTFORCE_ESTIMATOR_ARCHIVE) +
           " " + quoted(CUTFORCE_CONTROL_ARCHIVE) + " " + quoted(CUTFORCE_CAN_ARCHIVE));
  EXPECT_EQ(result.exit_status, 0) << result.output;
}

TEST(CoreSymbols, RefuseAnAllocation) { expect_refused("allocation", "_Znwm"); }

TEST(CoreSymbols, RefuseAThrow) { expect_refused("throw", "_ZSt24__throw_out_of_range_fmtPKcz"); }

TEST(CoreSymbols, RefuseAClock) { expect_refused("clock", "_ZNSt6chrono3_V212steady_clock3nowEv"); }

TEST(CoreSymbols, RefuseALibmFunctionWhoseBitsDiffer) { expect_refused("libm", "expf"); }

TEST(CoreSymbols, RefuseAGlobalThatChanges) {
  expect_refused("global", "_ZZN8cutforce7planted4nextEvE5count");
}

TEST(CoreSymbols, AcceptWhatAnArchiveBesideDefines) {
  // The planted archive beside itself cannot excuse it: new is not defined there either.
  const std::string planted = quoted(CUTFORCE_PLANTED_DIR "/libcutforce_planted_allocation.a");
  EXPECT_EQ(gate(" " + planted + " " + planted).exit_status, 1);
}

TEST(CoreSymbols, RefuseAnArchiveThatIsNotThere) {
  EXPECT_NE(gate(" /nowhere/libcore.a").exit_status, 0);
  EXPECT_NE(gate(" /dev/null").exit_status, 0);
}

}  // namespace
}  // namespace cutforce::host_tests
