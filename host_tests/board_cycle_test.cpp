// One tick over ports that exist only here: what is bounded, what is given up, and what is not
// kept.
#include "firmware/board_cycle.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <vector>

#include "support/bench_board.hpp"

namespace cutforce::host_tests {
namespace {

using control::Reason;
using control::SupervisorState;
using firmware::BoardHealth;
using firmware::BoardOutput;
using firmware::LoopOutput;

struct FakeCan {
  std::deque<hal::can::Frame> waiting;
  std::vector<hal::can::Frame> sent;
  bool has_room = true;
  std::size_t most_asked = 0;

  std::expected<std::size_t, hal::PortError> receive(std::span<hal::can::Frame> frames) {
    most_asked = std::max(most_asked, frames.size());
    const std::size_t count = std::min(frames.size(), waiting.size());
    std::copy_n(waiting.begin(), count, frames.begin());
    waiting.erase(waiting.begin(), waiting.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
  }
  std::expected<void, hal::SendError> send(const hal::can::Frame& frame) {
    if (!has_room) return std::unexpected{hal::SendError::kNoRoom};
    sent.push_back(frame);
    return {};
  }
  [[nodiscard]] hal::BusStatus status() const {
    hal::BusStatus status{};
    status.acknowledged = true;
    return status;
  }
};

struct FakeBytes {
  bool works = true;
  hal::ByteInput lines{.acknowledged = true, .inhibit = false};
  hal::ByteOutput last{};

  std::expected<hal::ByteInput, hal::PortError> write(const hal::ByteOutput& output) {
    if (!works) return std::unexpected{hal::PortError::kSystem};
    last = output;
    return lines;
  }
};

struct NoSource {
  std::expected<hal::Reading, hal::PortError> read(std::span<hal::Sample>) {
    return std::unexpected{hal::PortError::kLinkLost};
  }
};

constexpr std::size_t kFramesATick = 8;

// The bench's lathe on the fake bus, in control of its cut from 3 s on.
struct Wired {
  firmware::host::Scenario scenario = committed_scenario("bench_lathe");
  firmware::host::Bench bench = bench_with(scenario, bench_config());
  firmware::Board board = board_of(scenario);
  FakeCan can;
  FakeBytes bytes;
  firmware::BoardCycle<FakeCan, FakeBytes, NoSource, kFramesATick> cycle{
      board, {.can = &can, .bytes = &bytes, .source = nullptr}};
  std::int64_t now_ns = 1'000'000'000;
  std::size_t heard = 0;

  BoardOutput step() {
    std::array<hal::can::Frame, firmware::host::Bench::kMostFrames> frames;
    const std::size_t count = bench.step(frames);
    can.waiting.insert(can.waiting.end(), frames.begin(),
                       frames.begin() + static_cast<std::ptrdiff_t>(count));
    BoardHealth health{};
    health.self_test_done = health.self_test_passed = health.ports_open = true;
    const BoardOutput output = cycle.run(now_ns += 1'000'000, health, [](const LoopOutput&) {});
    for (; heard < can.sent.size(); ++heard) bench.receive(can.sent[heard]);
    return output;
  }
  BoardOutput run_to(double time_s) {
    BoardOutput output{};
    while (bench.now_ns() < static_cast<std::int64_t>(time_s * 1e9)) output = step();
    return output;
  }
};

TEST(BoardCycle, HoldsTheLatheAndPutsTheSameOverrideOnLinesAndBus) {
  Wired wired;
  wired.run_to(6.0);
  while (wired.bench.now_ns() < 8'000'000'000) {
    wired.step();
    ASSERT_EQ(wired.bytes.last.byte, wired.board.byte());
  }
  EXPECT_EQ(wired.board.supervision().state, SupervisorState::kControl);
}

TEST(BoardCycle, GivesUpLinesThatFailThreeTimesInARow) {
  Wired wired;
  wired.run_to(6.0);
  wired.bytes.works = false;
  wired.step();
  wired.step();
  wired.bytes.works = true;
  EXPECT_EQ(wired.run_to(6.1).supervision.state, SupervisorState::kControl);
  wired.bytes.works = false;
  const BoardOutput output = wired.run_to(6.11);
  EXPECT_EQ(output.supervision.state, SupervisorState::kSafe);
  EXPECT_EQ(output.supervision.reason, Reason::kOutput);
  EXPECT_FALSE(output.supervision.alive);
}

TEST(BoardCycle, GivesUpAReceiverThatAnswersNoStrobe) {
  Wired wired;
  wired.run_to(6.0);
  wired.bytes.lines.acknowledged = false;
  EXPECT_EQ(wired.run_to(6.19).supervision.state, SupervisorState::kControl);
  EXPECT_EQ(wired.run_to(6.22).supervision.state, SupervisorState::kSafe);
  EXPECT_EQ(wired.board.supervision().reason, Reason::kOutput);
}

TEST(BoardCycle, StopsRaisingWhileTheInhibitLineIsOn) {
  Wired wired;
  wired.run_to(6.0);
  wired.bytes.lines.inhibit = true;
  const BoardOutput output = wired.run_to(6.01);
  EXPECT_EQ(output.supervision.state, SupervisorState::kHold);
  EXPECT_EQ(output.supervision.reason, Reason::kInhibited);
}

// Very many frames in one go: a tick takes its bounded share, and the board goes on.
TEST(BoardCycle, TakesABoundedShareOfABabblingBus) {
  Wired wired;
  wired.run_to(6.0);
  hal::can::Frame stray;
  stray.id = hal::can::identifier(hal::can::Base::kJob, 1);
  stray.length = 8;
  for (int k = 0; k < 100'000; ++k) wired.can.waiting.push_back(stray);
  const std::size_t before = wired.can.waiting.size();
  wired.step();
  EXPECT_GE(wired.can.waiting.size() + kFramesATick, before);
  EXPECT_LE(wired.can.most_asked, kFramesATick);
}

// What could not be sent is not kept: when there is room again, what comes first is of now.
TEST(BoardCycle, SendsTheNewestWhenThereIsRoomAgain) {
  Wired wired;
  wired.run_to(6.0);
  wired.can.has_room = false;
  const std::size_t before = wired.can.sent.size();
  for (int k = 0; k < 100; ++k) wired.step();
  EXPECT_EQ(wired.can.sent.size(), before);
  wired.can.has_room = true;
  wired.step();
  ASSERT_EQ(wired.can.sent.size(), before + 1);
  const hal::can::Frame& first = wired.can.sent.back();
  ASSERT_EQ(first.id, hal::can::identifier(hal::can::Base::kOverride, 1));
  EXPECT_EQ(hal::can::unpack<hal::can::Override>(first)->override_pct,
            wired.board.supervision().override_pct);
}

TEST(BoardCycle, TellsAWatchdogWhenASourceIsGone) {
  firmware::Board board = board_of(committed_scenario("bench_lathe"));
  NoSource source;
  FakeCan can;
  firmware::BoardCycle<FakeCan, FakeBytes, NoSource> cycle(
      board, {.can = &can, .bytes = nullptr, .source = &source});
  for (int k = 0; k < 100; ++k) {
    cycle.run(k * 1'000'000, BoardHealth{}, [](const LoopOutput&) {});
  }
  EXPECT_EQ(cycle.bus_passes(), 100U);
  EXPECT_EQ(cycle.sample_passes(), 0U);
}

}  // namespace
}  // namespace cutforce::host_tests
