#include "firmware/host/machine_header.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <filesystem>
#include <string>

#include "firmware/cortex_m/default_lathe.hpp"
#include "firmware/host/machine_file.hpp"
#include "firmware/parameter_table.hpp"
#include "firmware/rating.hpp"
#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

using namespace firmware;

// The compiler has read the header of the tree; what it holds must be the machine, bit for bit.
TEST(MachineHeader, GivesTheCompilerTheBitsOfTheMachine) {
  Machine machine = complete_from_rating(default_machine()).value();
  machine.sample_rate_hz = 5000.0F;
  for (const Parameter& parameter : kParameters) {
    for (std::size_t k = 0; k < parameter.size(); ++k) {
      EXPECT_EQ(std::bit_cast<std::uint32_t>(parameter.get(kMachine, k)),
                std::bit_cast<std::uint32_t>(parameter.get(machine, k)))
          << parameter.key;
    }
  }
}

TEST(MachineHeader, OfTheTreeIsWhatTheProgramWritesNow) {
  const auto written = cutforce_output("embed --rate 5000");
  EXPECT_EQ(written.exit_status, 0);
  EXPECT_EQ(written.output,
            bytes_of(in_tests("..") / "firmware" / "cortex_m" / "default_lathe.hpp"))
      << "cutforce embed --rate 5000 --out firmware/cortex_m/default_lathe.hpp";
}

TEST(MachineHeader, IsNotWrittenForAMachineThatMakesNoLoop) {
  const ScratchFolder folder;
  const auto header = folder.file("machine_config.hpp");
  const auto no_rate = cutforce("embed --out " + q(header));
  EXPECT_EQ(no_rate.exit_status, 2);
  EXPECT_NE(no_rate.output.find("give sample_rate_hz"), std::string::npos) << no_rate.output;
  const auto file = folder.write("machine.toml", "[motor]\npole_pairs = -1\n");
  const auto broken = cutforce("embed " + q(file) + " --rate 5000 --out " + q(header));
  EXPECT_EQ(broken.exit_status, 2);
  EXPECT_NE(broken.output.find("pole_pairs"), std::string::npos) << broken.output;
  EXPECT_FALSE(std::filesystem::exists(header));
}

}  // namespace
}  // namespace cutforce::host_tests
