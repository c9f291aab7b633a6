// peer_lines_v2.cpp over the stand-in; beside gpio_lines_v2_check.cpp in one program.
#include <gpiod.h>
#include <gtest/gtest.h>

#include "hal/linux/peer_lines.hpp"
#include "libgpiod_v2/stand_in.hpp"

namespace cutforce::host_tests {
namespace {

using hal::os::GpioConfig;
using hal::os::GpioLine;
using hal::os::LineEdge;
using hal::os::PeerLines;

class PeerLinesOverV2 : public testing::Test {
 protected:
  PeerLinesOverV2() { stand_in = {}; }
  ~PeerLinesOverV2() override {
    EXPECT_EQ(stand_in.alive_objects, 0) << "the library's own leaked";
  }

  GpioConfig config{.chip = "stand-in",
                    .data = {7, 6, 5, 4},
                    .data_active_low = true,
                    .strobe = {8, false},
                    .alive = GpioLine{9, true},
                    .alarm = GpioLine{10, false},
                    .acknowledge = {},
                    .inhibit = GpioLine{12, true},
                    .initial_byte = 0,
                    .setup_us = 1,
                    .hold_us = 1,
                    .consumer = "cutforce cnc"};
};

TEST_F(PeerLinesOverV2, DrivesNoLineButInhibitAndThatIsOffAtFirst) {
  auto lines = PeerLines::open(config);
  ASSERT_TRUE(lines) << lines.error().text();
  EXPECT_EQ(stand_in.consumer, "cutforce cnc");
  for (unsigned i = 0; i < StandIn::kLines; ++i) EXPECT_EQ(stand_in.output[i], i == 12) << i;
  EXPECT_EQ(stand_in.level[12], 0);
  EXPECT_TRUE(stand_in.active_low[7] && stand_in.active_low[9] && stand_in.active_low[12]);
  EXPECT_FALSE(stand_in.active_low[8] || stand_in.active_low[10]);
  EXPECT_EQ(stand_in.edges[8], GPIOD_LINE_EDGE_RISING);
  EXPECT_EQ(stand_in.edges[9], GPIOD_LINE_EDGE_BOTH);
  EXPECT_EQ(stand_in.edges[7], GPIOD_LINE_EDGE_NONE);
  ASSERT_TRUE(lines->set_inhibit(true));
  EXPECT_EQ(stand_in.level[12], 1);
}

TEST_F(PeerLinesOverV2, GivesEdgesInTheirOrderWithTheirTimesAndNeverWaits) {
  auto lines = PeerLines::open(config);
  ASSERT_TRUE(lines);
  std::array<LineEdge, 2> edges{};
  EXPECT_EQ(lines->edges(edges).value(), 0U);
  stand_in.queue = {{9, true, 100}, {8, true, 200}, {10, false, 300}};
  ASSERT_EQ(lines->edges(edges).value(), 2U);
  EXPECT_EQ(edges[0].line, LineEdge::Line::kAlive);
  EXPECT_TRUE(edges[0].active);
  EXPECT_EQ(edges[1].line, LineEdge::Line::kStrobe);
  EXPECT_EQ(edges[1].time_ns, 200);
  ASSERT_EQ(lines->edges(edges).value(), 1U);
  EXPECT_EQ(edges[0].line, LineEdge::Line::kAlarm);
  EXPECT_FALSE(edges[0].active);
}

TEST_F(PeerLinesOverV2, PutsTheFirstLineInBitZero) {
  auto lines = PeerLines::open(config);
  ASSERT_TRUE(lines);
  stand_in.level[7] = 1;
  EXPECT_EQ(lines->data().value(), 0x01);
  stand_in.level[4] = 1;
  EXPECT_EQ(lines->data().value(), 0x09);
  stand_in.level[10] = 1;
  EXPECT_TRUE(lines->alarm().value());
  stand_in.refuse = true;
  std::array<LineEdge, 2> edges{};
  EXPECT_FALSE(lines->data() || lines->alarm() || lines->edges(edges) || lines->set_inhibit(true));
}

TEST_F(PeerLinesOverV2, SaysWhatToDoWhereALineIsHeldOrTheChipDetectsNoEdges) {
  stand_in.busy_line = 9;
  EXPECT_EQ(PeerLines::open(config).error().what, "alive, line 9 is held by \"spi0 CS0\"");
  stand_in.busy_line = -1;
  stand_in.no_edges = true;
  const auto refused = PeerLines::open(config);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().what.find("the chip detects no edges"), std::string::npos);
  EXPECT_NE(refused.error().remedy.find("whose lines interrupt"), std::string::npos);
}

}  // namespace
}  // namespace cutforce::host_tests
