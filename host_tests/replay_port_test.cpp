#include "hal/host/replay_port.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "support/recording_text.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce {
namespace {

using hal::Sample;
using hal::host::RecordingReader;
using host_tests::ScratchFolder;
using host_tests::sound_recording;

TEST(ReplayPort, PassesCommandsOnAndKeepsTheFirstError) {
  const ScratchFolder folder;
  const auto path = folder.write("bad.csv", sound_recording() + "0.002,1,2,3,4,nan\n");
  std::vector<hal::Command> commands;
  hal::host::ReplayPort port(RecordingReader::open(path).value(),
                             [&](const hal::Command& command) { commands.push_back(command); });
  std::vector<Sample> block(1);
  EXPECT_EQ(port.read(block).value(), 1U);
  EXPECT_TRUE(
      port.write({.time_ns = 5, .override_pct = 90, .override_code = 1, .controlling = true}));
  EXPECT_EQ(port.read(block).value(), 1U);
  EXPECT_FALSE(port.error());
  EXPECT_EQ(port.read(block).error(), hal::PortError::kMalformed);
  EXPECT_EQ(port.read(block).error(), hal::PortError::kMalformed);
  EXPECT_TRUE(port.error()->where.ends_with("bad.csv:5:15"));
  ASSERT_EQ(commands.size(), 1U);
  EXPECT_EQ(commands[0].override_pct, 90);
}

}  // namespace
}  // namespace cutforce
