#include "firmware/linux/board_file.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <vector>

#include "support/scratch_folder.hpp"

namespace cutforce::firmware::board {
namespace {

constexpr std::string_view kLeast = R"(machine = "lathe.toml"
[can]
interface = "can0"
node = 7
[samples]
source = "can"
voltage_full_scale_v = 400
current_full_scale_a = 150
)";
constexpr std::string_view kLines = R"([gpio]
chip = "gpiochip0"
data = [0, 1, 2, 3, 4, 5, 6, 7]
strobe = 8
)";

std::string with(std::string_view more) { return std::string(kLeast) + std::string(more); }

// The text with one of its lines replaced.
std::string replaced(std::string text, std::string_view line, std::string_view by) {
  const auto at = text.find(line);
  EXPECT_NE(at, std::string::npos) << line;
  return text.replace(at, line.size(), by);
}

TEST(BoardFile, NeedsOnlyMachineBusAndSource) {
  const auto file = parse_board_text(kLeast, "board.toml");
  ASSERT_TRUE(file) << file.error().front().what;
  EXPECT_EQ(file->can.interface, "can0");
  EXPECT_EQ(file->can.node, 7);
  EXPECT_EQ(file->origin, SampleOrigin::kCan);
  EXPECT_FALSE(file->gpio || file->iio || file->watchdog || file->trace);
  EXPECT_FLOAT_EQ(file->tick_s, 0.001F);
}

TEST(BoardFile, ReadsTheExampleThatIsShipped) {
  const auto file = read_board_file(CUTFORCE_SOURCE_DIR "/firmware/linux/board.example.toml");
  ASSERT_TRUE(file) << file.error().front().where << file.error().front().what;
  EXPECT_EQ(file->machine,
            std::filesystem::path(CUTFORCE_SOURCE_DIR) / "firmware/linux/lathe.toml");
  ASSERT_TRUE(file->gpio);
  EXPECT_EQ(file->gpio->data.size(), 8U);
}

// What is commented out in the example is right as well.
TEST(BoardFile, ReadsTheExampleWithEverythingSwitchedOn) {
  std::ifstream in(CUTFORCE_SOURCE_DIR "/firmware/linux/board.example.toml");
  std::string text;
  for (std::string line; std::getline(in, line);) {
    const bool switched_off = line.starts_with("# [") ||
                              (line.starts_with("# ") && line.find(" = ") != std::string::npos);
    text += (switched_off ? line.substr(2) : line) + "\n";
  }
  const auto file = parse_board_text(text, "example");
  ASSERT_TRUE(file) << file.error().front().where << ": " << file.error().front().what;
  EXPECT_TRUE(file->iio && file->watchdog && file->trace && file->gpio->inhibit);
  EXPECT_EQ(file->iio->speed, "in_voltage6");
  EXPECT_EQ(file->trace->keep, 144U);
}

struct Mistake {
  std::string text;
  std::string where;  // the place
  std::string what;   // words that the error must have
};

class BoardFileMistakes : public testing::TestWithParam<Mistake> {};

TEST_P(BoardFileMistakes, IsNamedWithItsPlaceAndARemedy) {
  const auto file = parse_board_text(GetParam().text, "board.toml");
  ASSERT_FALSE(file) << GetParam().text;
  const bool named = std::ranges::any_of(file.error(), [](const auto& error) {
    return error.where.starts_with(GetParam().where) &&
           error.what.find(GetParam().what) != std::string::npos && !error.remedy.empty();
  });
  std::string all;
  for (const auto& error : file.error()) all += error.where + ": " + error.what + "\n";
  EXPECT_TRUE(named) << all;
}

std::vector<Mistake> mistakes() {
  const std::string least(kLeast);
  const std::string lines(kLines);
  const auto gpio = [&](std::string_view line, std::string_view by) {
    return with(replaced(lines, line, by));
  };
  return {
      {"", "board.toml", "machine"},
      {replaced(least, "machine = \"lathe.toml\"", ""), "board.toml", "machine"},
      {replaced(least, "node = 7", "node = 0"), "board.toml:4", "node"},
      {replaced(least, "node = 7", "node = 128"), "board.toml:4", "node"},
      {replaced(least, "node = 7", ""), "board.toml:2", "node"},
      {replaced(least, "interface = \"can0\"", "interface = 0"), "board.toml:3", "text"},
      {replaced(least, "source = \"can\"", "source = \"spi\""), "board.toml:6", "source"},
      {replaced(least, "source = \"can\"", "source = \"iio\""), "board.toml:6", "[iio]"},
      {replaced(least, "voltage_full_scale_v = 400", ""), "board.toml:5", "voltage_full_scale_v"},
      {replaced(least, "current_full_scale_a = 150", "current_full_scale_a = -1"), "board.toml:8",
       "current_full_scale_a"},
      {with("[gpoi]\n"), "board.toml:9", "gpoi"},
      {with("[run]\npriority = 99\n"), "board.toml:10", "priority"},
      {with("[run]\ntick_s = 1\n"), "board.toml:10", "tick_s"},
      {with("[trace]\nkeep = 3\n"), "board.toml:9", "folder"},
      {with("[watchdog]\ntimeout_s = 0\n"), "board.toml:10", "timeout_s"},
      {gpio("data = [0, 1, 2, 3, 4, 5, 6, 7]", "data = [0, 1, 2]"), "board.toml:11", "3 lines"},
      {gpio("data = [0, 1, 2, 3, 4, 5, 6, 7]", "data = [0, 1, 2, 3, 4, 5, 6, 6]"), "board.toml:11",
       "twice"},
      {gpio("data = [0, 1, 2, 3, 4, 5, 6, 7]", "data = [0, 1, 2, 3, 4, 5, 6, 7.5]"),
       "board.toml:11", "whole number"},
      {gpio("strobe = 8", "strobe = 8\nhold_us = 1451"), "board.toml:13", "skip ticks"},
      {gpio("strobe = 8", ""), "board.toml:9", "strobe"},
      {gpio("strobe = 8", "strobe = 3"), "board.toml:12", "used twice"},
      {gpio("strobe = 8", "strobe = 8\nactive_low = [9]"), "board.toml:13", "not used"},
      {gpio("strobe = 8", "strobe = 8\nactive_low = [2]"), "board.toml:13", "data line"},
      {gpio("chip = \"gpiochip0\"", ""), "board.toml:9", "chip"},
      {with("[iio]\ndevice = \"x\"\nvoltage = [\"a\"]\ncurrent = [\"b\", \"c\"]\nvoltage_v_v = 1\n"
            "current_a_v = 1\n"),
       "board.toml:11", "1 channels"},
  };
}
INSTANTIATE_TEST_SUITE_P(Each, BoardFileMistakes, testing::ValuesIn(mistakes()));

TEST(BoardFile, AMissingFileIsAnErrorAndNotAnEmptyBoard) {
  const auto file = read_board_file("/nowhere/board.toml");
  ASSERT_FALSE(file);
  EXPECT_NE(file.error().front().where.find("/nowhere/board.toml"), std::string::npos);
}

}  // namespace
}  // namespace cutforce::firmware::board
