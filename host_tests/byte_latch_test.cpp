// A board that writes its byte line by line, and a receiver that looks when it gets to it.
#include "hal/linux/byte_latch.hpp"

#include <gtest/gtest.h>

#include <deque>
#include <functional>
#include <random>
#include <vector>

#include "hal/linux/byte_sequence.hpp"
#include "hal/linux/peer_lines.hpp"

namespace cutforce::hal::os {
namespace {

struct World {
  std::int64_t now_ns = 0;
  std::uint8_t data = 0;
  bool alarm = false;
  bool refuse = false;
  std::deque<LineEdge> edges;

  void edge(LineEdge::Line line, bool active = true) { edges.push_back({line, active, now_ns}); }
  void strobe() { edge(LineEdge::Line::kStrobe); }
};

struct FakeLines {
  World* world;

  std::expected<std::size_t, PortError> edges(std::span<LineEdge> out) const {
    if (world->refuse) return std::unexpected{PortError::kSystem};
    std::size_t count = 0;
    while (count < out.size() && !world->edges.empty()) {
      out[count++] = world->edges.front();
      world->edges.pop_front();
    }
    return count;
  }
  std::expected<std::uint8_t, PortError> data() const { return world->data; }
  std::expected<bool, PortError> alarm() const { return world->alarm; }
};

struct Clock {
  World* world;
  std::int64_t operator()() const noexcept { return world->now_ns; }
};

class ByteLatchTest : public testing::Test {
 protected:
  World world;
  ByteLatch<FakeLines, Clock> latch{FakeLines{&world}, Clock{&world}};

  // What a call delivers, bytes alone.
  std::vector<unsigned> bytes(std::size_t room = 64) {
    std::vector<unsigned> out;
    for (const auto& event : events(room)) {
      if (event.kind == PeerEvent::Kind::kByte) out.push_back(event.value);
    }
    return out;
  }
  std::vector<PeerEvent> events(std::size_t room = 64) {
    std::vector<PeerEvent> seen(room);
    seen.resize(latch.read(seen).value());
    return seen;
  }
};
using Bytes = std::vector<unsigned>;

TEST_F(ByteLatchTest, TakesTheByteAtTheStrobeAndAtNoOtherTime) {
  world.data = 100;
  EXPECT_EQ(bytes(), Bytes{});
  world.strobe();
  EXPECT_EQ(bytes(), Bytes{100});
  for (unsigned byte = 0; byte < 256; ++byte) {
    world.data = static_cast<std::uint8_t>(byte);
    world.now_ns += 1'000'000;
    EXPECT_EQ(bytes(), Bytes{});
  }
  world.edge(LineEdge::Line::kStrobe, false);
  EXPECT_EQ(bytes(), Bytes{});
  world.strobe();
  EXPECT_EQ(bytes(), Bytes{255});
}

TEST_F(ByteLatchTest, DeliversTheSameByteAgainWhereItIsStrobedAgain) {
  for (int k = 0; k < 3; ++k) {
    world.strobe();
    EXPECT_EQ(bytes(), Bytes{0});
  }
}

TEST_F(ByteLatchTest, BelievesAByteThatItReadLateOnlyWhenItRests) {
  world.data = 80;
  world.strobe();
  world.now_ns += decltype(latch)::kFresh_ns + 1;
  world.data = 0x5F;  // the board is in the midst of the next
  EXPECT_EQ(bytes(), Bytes{});
  world.data = 90;
  EXPECT_EQ(bytes(), Bytes{});
  world.now_ns += decltype(latch)::kRest_ns - 1;
  EXPECT_EQ(bytes(), Bytes{});
  world.now_ns += 1;
  EXPECT_EQ(bytes(), Bytes{90});
  EXPECT_EQ(bytes(), Bytes{});
}

TEST_F(ByteLatchTest, ForgetsWhatItReadLateWhenAnotherStrobeComes) {
  world.strobe();
  world.now_ns += 1'000'000'000;
  world.data = 7;
  EXPECT_EQ(bytes(), Bytes{});
  world.strobe();  // fresh: believed at once
  EXPECT_EQ(bytes(), Bytes{7});
  EXPECT_EQ(bytes(), Bytes{});
}

TEST_F(ByteLatchTest, DeliversTheLastOfTheBytesItWasTooLateFor) {
  for (const std::uint8_t byte : std::initializer_list<std::uint8_t>{10, 20, 30}) {
    world.data = byte;
    world.strobe();
    world.now_ns += 100'000;
  }
  EXPECT_EQ(bytes(), Bytes{30});
  EXPECT_EQ(bytes(), Bytes{});
}

TEST_F(ByteLatchTest, TellsOtherLinesInTheirOrderAndTheByteAfterThem) {
  world.alarm = true;
  world.edge(LineEdge::Line::kAlive, true);
  world.strobe();
  world.edge(LineEdge::Line::kAlive, false);
  world.edge(LineEdge::Line::kAlarm, false);
  const auto seen = events();
  using Kind = PeerEvent::Kind;
  const std::vector<std::pair<Kind, unsigned>> wanted{
      {Kind::kAlarm, 1}, {Kind::kAlive, 1}, {Kind::kAlive, 0}, {Kind::kAlarm, 0}, {Kind::kByte, 0}};
  ASSERT_EQ(seen.size(), wanted.size());
  for (std::size_t k = 0; k < seen.size(); ++k) {
    EXPECT_EQ(seen[k].kind, wanted[k].first) << k;
    EXPECT_EQ(seen[k].value, wanted[k].second) << k;
  }
  EXPECT_TRUE(events().empty());  // the alarm that was on before is told once
}

TEST_F(ByteLatchTest, LosesNothingWhereThereIsLittleRoom) {
  world.alarm = true;
  for (int k = 0; k < 100; ++k) world.edge(LineEdge::Line::kAlive, k % 2 == 0);
  world.strobe();
  std::size_t edges = 0;
  std::size_t bytes = 0;
  for (int k = 0; k < 200; ++k) {
    for (const auto& event : events(2)) {
      edges += event.kind == PeerEvent::Kind::kAlive ? 1 : 0;
      bytes += event.kind == PeerEvent::Kind::kByte ? 1 : 0;
    }
  }
  EXPECT_EQ(edges, 100U);
  EXPECT_EQ(bytes, 1U);
  EXPECT_EQ(events(0).size() + events(1).size(), 0U);
}

TEST_F(ByteLatchTest, ReportsALineThatTheSystemRefuses) {
  world.refuse = true;
  std::array<PeerEvent, 4> room;
  EXPECT_FALSE(latch.read(room));
}

// The board's own sequence over the same lines; whenever it waits or is about to change a line, the
// receiver may look, late or not. No byte may come out that the board did not mean.
struct BoardLines {
  World* world;
  std::function<void(bool)> look;

  std::expected<void, PortError> set_data(std::uint8_t byte) const {
    for (unsigned bit = 0; bit < 8; ++bit) {
      const unsigned mask = 1U << bit;
      look(true);
      world->data = static_cast<std::uint8_t>((world->data & ~mask) | (byte & mask));
      world->now_ns += 2'000;
    }
    return {};
  }
  std::expected<void, PortError> set_strobe(bool active) const {
    look(false);
    if (active) world->strobe();
    return {};
  }
  std::expected<void, PortError> set_alive(bool) const { return {}; }
  std::expected<void, PortError> set_alarm(bool) const { return {}; }
  std::expected<bool, PortError> acknowledge() const { return true; }
  std::expected<bool, PortError> inhibit() const { return false; }
};

TEST_F(ByteLatchTest, TakesNoTornByteHoweverLateItLooks) {
  std::mt19937 random(1);
  const auto below = [&](int n) { return std::uniform_int_distribution<int>(0, n - 1)(random); };
  unsigned meant = 0;
  unsigned last = 0;
  std::uint64_t taken = 0;
  std::uint64_t torn = 0;
  std::int64_t looked_ns = -1;
  bool held_up = false;
  // A program with a period of 1 ms. Now and then it is held up, and comes back in the midst of a
  // byte that is being written, this one or one of the next.
  const auto look = [&](bool writing) {
    if (held_up ? !writing || below(8) != 0 : world.now_ns - looked_ns < 1'000'000) return;
    held_up = below(100) == 0;
    looked_ns = world.now_ns;
    for (const unsigned byte : bytes()) {
      ++taken;
      torn += byte != meant && byte != last ? 1 : 0;
    }
  };
  const auto wait = [&](std::int64_t time_ns) {
    look(false);
    world.now_ns += time_ns;
  };
  ByteSequence<BoardLines, decltype(wait)> board(
      BoardLines{&world, look}, wait,
      {.setup_ns = 50'000, .hold_ns = 50'000, .has_acknowledge = false, .has_inhibit = false});
  for (int k = 0; k < 20'000; ++k) {
    last = meant;
    meant = static_cast<unsigned>(below(256));
    ASSERT_TRUE(board.write({.byte = static_cast<std::uint8_t>(meant),
                             .alive = false,
                             .alarm = false,
                             .again = false}));
    for (int ms = 0; ms < 50; ++ms) {
      look(false);
      world.now_ns += 1'000'000;
    }
  }
  EXPECT_EQ(torn, 0U);
  EXPECT_GT(taken, 10'000U);
}

TEST(PeerLines, AreRefusedInWordsWhereTheChipIsNotThere) {
  const auto refused = PeerLines::open({.chip = "no-such-chip",
                                        .data = {0, 1, 2, 3},
                                        .data_active_low = false,
                                        .strobe = {4, false},
                                        .alive = {},
                                        .alarm = {},
                                        .acknowledge = {},
                                        .inhibit = {},
                                        .initial_byte = 0,
                                        .setup_us = 1,
                                        .hold_us = 1,
                                        .consumer = "cutforce cnc"});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text().find("no-such-chip: there is no such chip"), std::string::npos);
}

}  // namespace
}  // namespace cutforce::hal::os
