#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "support/run_command.hpp"

namespace cutforce::host_tests {
namespace {

CommandResult count(const std::string& arguments) {
  return run_command("CUTFORCE_COUNT=" + quoted(CUTFORCE_COUNT) + " " +
                     quoted(CUTFORCE_SOURCE_DIR "/toolchain/count_instructions.sh") + " " +
                     arguments + " 2>&1");
}

double figure(const std::string& output, const std::string& body) {
  const auto at = output.find("\n" + body + " ");
  if (at == std::string::npos) return -1.0;
  return std::atof(output.c_str() + at + 1 + body.size());
}

TEST(InstructionCount, IsWholeForWorkThatIsTheSameEachTimeAndAddsUp) {
  if (run_command("command -v valgrind").exit_status != 0) GTEST_SKIP() << "valgrind is missing";
  const auto counted = count("empty space_vector_dot");
  ASSERT_EQ(counted.exit_status, 0) << counted.output;
  const double empty = figure(counted.output, "empty");
  const double power = figure(counted.output, "space_vector_dot");
  EXPECT_GE(empty, 1.0) << counted.output;
  EXPECT_LE(empty, 6.0) << counted.output;
  EXPECT_EQ(empty, static_cast<int>(empty)) << counted.output;
  // Four loads, two products, one sum, one factor.
  EXPECT_GE(power - empty, 4.0) << counted.output;
  EXPECT_LE(power - empty, 20.0) << counted.output;
  EXPECT_EQ(power, static_cast<int>(power)) << counted.output;
}

TEST(InstructionCount, RefusesABodyThatIsNotThere) {
  if (run_command("command -v valgrind").exit_status != 0) GTEST_SKIP() << "valgrind is missing";
  const auto counted = count("no_such_body");
  EXPECT_NE(counted.exit_status, 0);
  EXPECT_NE(counted.output.find("no body is named no_such_body"), std::string::npos)
      << counted.output;
}

}  // namespace
}  // namespace cutforce::host_tests
