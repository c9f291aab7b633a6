// The board's own rules: whose clock counts, what the CNC may narrow, and what stops at once. The
// whole of it beside a lathe: bench_test.cpp.
#include "firmware/board.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <vector>

#include "firmware/configuration_board.hpp"
#include "hal/can/guard.hpp"
#include "support/allocation_count.hpp"
#include "support/bench_board.hpp"

namespace cutforce::host_tests {
namespace {

using control::Reason;
using control::SupervisorState;
using firmware::Board;
using firmware::BoardHealth;
using firmware::host::Bench;
using hal::BusState;
using hal::can::Frame;

constexpr std::int64_t kTick_ns = 1'000'000;

BoardHealth well() {
  BoardHealth health{};
  health.self_test_done = health.self_test_passed = health.ports_open = health.has_bus = true;
  health.bus.acknowledged = true;
  return health;
}

// Board and bench, run for so long in sample time.
struct Running {
  firmware::host::Scenario scenario = committed_scenario("bench_lathe");
  Bench bench;
  Board board;
  BenchTogether together{.bench = bench, .board = board};

  explicit Running(const Bench::Config& config = bench_config())
      : bench(bench_with(scenario, config)), board(board_of(scenario)) {}

  void run_to(double time_s) {
    while (bench.now_ns() < static_cast<std::int64_t>(time_s * 1e9)) together.step();
  }
  [[nodiscard]] SupervisorState state() const { return board.supervision().state; }

  // Ticks without anything coming in; how many until the state is another.
  int ticks_until_change(const BoardHealth& health, int most) {
    const SupervisorState before = state();
    for (int k = 1; k <= most; ++k) {
      static_cast<void>(board.tick(together.clock_ns += kTick_ns, health));
      if (state() != before) return k;
    }
    return most + 1;
  }
};

TEST(Board, IsInControlOfTheCutWhenTheLatheRuns) {
  Running running;
  running.run_to(1.0);
  EXPECT_EQ(running.state(), SupervisorState::kReady);
  running.run_to(6.0);
  EXPECT_EQ(running.state(), SupervisorState::kControl);
  EXPECT_NEAR(running.board.measured_rate_hz(), 1000.0F, 10.0F);
}

// Without samples and frames the clock goes on: hold from half the time, then the link is lost.
TEST(Board, GoesOnByItsClockWhenNothingComes) {
  Running running;
  running.run_to(6.0);
  const std::uint8_t before_pct = running.board.supervision().override_pct;
  const float link_timeout_s = running.scenario.machine.link_timeout_s;
  int ticks = 0;
  while (running.state() != SupervisorState::kSafe &&
         running.state() != SupervisorState::kLinkLost && ticks < 1000) {
    ticks += running.ticks_until_change(well(), 1000 - ticks);
    EXPECT_LE(running.board.supervision().override_pct, before_pct);
  }
  EXPECT_LE(ticks, static_cast<int>(1000.0F * link_timeout_s) + 21);
  EXPECT_GE(ticks, 20);
}

// A stall is not made up for step by step, but it is seen: the link is lost at the next tick, and
// the clock goes on from there in its steps.
TEST(Board, LosesTheLinkAtTheFirstTickAfterAStall) {
  Running running;
  running.run_to(6.0);
  ASSERT_EQ(running.state(), SupervisorState::kControl);
  const std::uint8_t before_pct = running.board.supervision().override_pct;
  running.together.clock_ns += 10'000'000'000;
  BoardHealth health = well();
  health.missed_ticks = 9999;
  static_cast<void>(running.board.tick(running.together.clock_ns, health));
  EXPECT_GE(running.state(), SupervisorState::kLinkLost);
  EXPECT_LE(running.board.supervision().override_pct, before_pct);
  const SupervisorState after = running.state();
  std::uint8_t last_pct = running.board.supervision().override_pct;
  for (int k = 0; k < 5000; ++k) {
    static_cast<void>(running.board.tick(running.together.clock_ns += kTick_ns, well()));
    ASSERT_GE(running.state(), after);
    ASSERT_LE(running.board.supervision().override_pct, last_pct);
    last_pct = running.board.supervision().override_pct;
  }
}

TEST(Board, StopsAtOnceWhenTheBusGoesOff) {
  for (const BusState state : {BusState::kOff, BusState::kDown}) {
    Running running;
    running.run_to(6.0);
    BoardHealth health = well();
    health.bus.state = state;
    EXPECT_EQ(running.ticks_until_change(health, 10), 1);
    EXPECT_EQ(running.state(), SupervisorState::kLinkLost);
    EXPECT_EQ(running.board.supervision().reason, Reason::kBusDown);
    EXPECT_FALSE(running.board.tick(running.together.clock_ns += kTick_ns, health).frame);
  }
}

TEST(Board, TakesABusOnWhichNobodyAnswersForDown) {
  Running running;
  running.run_to(6.0);
  BoardHealth health = well();
  health.bus.acknowledged = false;
  EXPECT_EQ(running.ticks_until_change(health, 10), 1);
  EXPECT_EQ(running.state(), SupervisorState::kLinkLost);
}

TEST(Board, StopsAtOnceWhenItIsToldTo) {
  Running running;
  running.run_to(6.0);
  BoardHealth health = well();
  health.stop = true;
  EXPECT_EQ(running.ticks_until_change(health, 10), 1);
  EXPECT_EQ(running.state(), SupervisorState::kDead);
  const std::uint8_t pct = running.board.supervision().override_pct;
  for (int k = 0; k < 1000; ++k) {
    const auto out = running.board.tick(running.together.clock_ns += kTick_ns, health);
    EXPECT_FALSE(out.byte.alive && k > 0);
    EXPECT_LE(out.supervision.override_pct, pct);
  }
}

// Late by any time below the silence: the same decisions, sample for sample.
TEST(Board, DecidesByWhatCameAndNotByWhenItWasAwake) {
  std::mt19937 random(5);
  Running prompt;
  Running late;
  std::uniform_int_distribution<std::int64_t> delay_ns(0, 9'000'000);
  late.together.delay_ns = [&] { return delay_ns(random); };
  for (int k = 0; k < 9000; ++k) {
    prompt.together.step();
    late.together.step();
    ASSERT_EQ(prompt.board.supervision().override_pct, late.board.supervision().override_pct) << k;
    ASSERT_EQ(prompt.state(), late.state()) << k;
  }
}

TEST(Board, IsNotReadyWithAnotherSampleRateThanTheMachineFileSays) {
  Running running;
  // Every other sample is lost on its way: 500 Hz for 1 kHz.
  int k = 0;
  std::array<Frame, Bench::kMostFrames> frames;
  while (running.bench.now_ns() < 3'000'000'000) {
    const std::size_t count = running.bench.step(frames);
    const bool dropped = ++k % 2 == 0;
    for (std::size_t n = 0; n < count; ++n) {
      const bool sample = frames[n].id == hal::can::identifier(hal::can::Base::kPhases, 1);
      if (dropped && sample) continue;
      static_cast<void>(running.board.receive(frames[n], running.together.clock_ns));
    }
    static_cast<void>(running.board.tick(running.together.clock_ns += kTick_ns, well()));
  }
  EXPECT_EQ(running.state(), SupervisorState::kCheck);
}

// What a Job says can make the range narrower, never wider, and never lifts the machine's limit.
TEST(Board, LetsAJobNarrowAndNotWiden) {
  for (const auto& [ceiling, expected] : {std::pair{70, 70}, std::pair{250, 200}}) {
    auto config = bench_config();
    config.job.ceiling_pct = static_cast<std::uint8_t>(ceiling);
    config.job.force_reference_n = 8000.0F;  // more than the lathe ever has: the override rises
    Running running(config);
    const float most_pct = running.scenario.machine.override_ceiling_pct;
    std::uint8_t highest_pct = 0;
    while (running.bench.now_ns() < 8'000'000'000) {
      running.together.step();
      if (running.bench.now_ns() > 4'000'000'000) {
        highest_pct = std::max(highest_pct, running.board.supervision().override_pct);
      }
    }
    EXPECT_LE(static_cast<float>(highest_pct), std::min(static_cast<float>(expected), most_pct));
    EXPECT_GE(highest_pct, 60);
  }
}

// A foreign node with our identifiers is told; our own frames, heard back, are not.
TEST(Board, KnowsItsOwnFramesFromATwins) {
  Running running;
  running.run_to(6.0);
  Frame frame = hal::can::pack(hal::can::Heartbeat{.nmt_state = 5}, 1);
  frame.own = true;
  static_cast<void>(running.board.receive(frame, running.together.clock_ns));
  running.run_to(6.1);
  EXPECT_EQ(running.state(), SupervisorState::kControl);
  frame.own = false;
  static_cast<void>(running.board.receive(frame, running.together.clock_ns));
  running.run_to(6.12);
  EXPECT_EQ(running.state(), SupervisorState::kSafe);
  EXPECT_EQ(running.board.supervision().reason, Reason::kForeign);
}

TEST(Board, TakesNoHarmFromAnyFrame) {
  Running running;
  std::mt19937_64 random(11);
  Board board = running.board;
  std::int64_t now_ns = 0;
  const auto before = allocation_count();
  for (int k = 0; k < 300'000; ++k) {
    Frame frame;
    const std::uint64_t bits = random();
    std::memcpy(frame.data.data(), &bits, sizeof bits);
    const std::uint64_t more = random();
    constexpr std::array kBases{hal::can::Base::kPhases, hal::can::Base::kSpindle,
                                hal::can::Base::kMachineState, hal::can::Base::kJob};
    frame.id = hal::can::identifier(kBases[more % kBases.size()], 1);
    frame.length = (more & 0xF00U) == 0 ? static_cast<std::uint8_t>(more >> 12U) : 8;
    frame.extended = (more & 0xF0000U) == 0;
    static_cast<void>(board.receive(frame, now_ns));
    const auto out = board.tick(now_ns += static_cast<std::int64_t>(more % 2'000'000), well());
    ASSERT_LE(out.supervision.override_pct, 100) << k;  // nobody armed it
    ASSERT_NE(out.supervision.state, SupervisorState::kControl) << k;
  }
  EXPECT_EQ(allocation_count(), before);
}

// A converter's DMA delivers blocks; their length is nobody's business but the converter's.
TEST(Board, TakesABlockAsItsSamplesOneByOne) {
  const auto recorded = committed_recording("entry_cut");
  const auto board = firmware::make_board(recorded.machine, {.node = 1,
                                                             .samples_by_can = false,
                                                             .voltage_full_scale_v = 400.0F,
                                                             .current_full_scale_a = 100.0F});
  ASSERT_TRUE(board);
  Board singly = *board;
  Board in_blocks = *board;
  std::vector<firmware::LoopOutput> expected;
  std::vector<firmware::LoopOutput> got;
  const auto expect = [&](const firmware::LoopOutput& row) { expected.push_back(row); };
  const auto get = [&](const firmware::LoopOutput& row) { got.push_back(row); };
  std::mt19937 random(29);
  std::int64_t now_ns = kTick_ns;
  for (std::size_t at = 0; at < recorded.samples.size(); now_ns += kTick_ns) {
    const std::size_t count = std::min<std::size_t>(random() % 12, recorded.samples.size() - at);
    std::vector<hal::Sample> block(
        recorded.samples.begin() + static_cast<std::ptrdiff_t>(at),
        recorded.samples.begin() + static_cast<std::ptrdiff_t>(at + count));
    for (hal::Sample sample : block) singly.samples({&sample, 1}, now_ns, expect);
    in_blocks.samples(block, now_ns, get);
    at += count;
    ASSERT_EQ(got.size(), expected.size());
    const auto a = singly.tick(now_ns, well());
    const auto b = in_blocks.tick(now_ns, well());
    ASSERT_EQ(a.supervision.state, b.supervision.state) << at;
    ASSERT_EQ(a.byte.byte, b.byte.byte) << at;
  }
  ASSERT_GT(got.size(), 1000U);
  for (std::size_t k = 0; k < got.size(); ++k) ASSERT_EQ(bytes_of(got[k]), bytes_of(expected[k]));
  EXPECT_FLOAT_EQ(singly.measured_rate_hz(), in_blocks.measured_rate_hz());
}

TEST(Board, ContinuesFromACopyBitForBit) {
  Running running;
  running.run_to(5.0);
  Board copy = running.board;
  Bench bench = running.bench;
  BenchTogether other{.bench = bench, .board = copy, .clock_ns = running.together.clock_ns};
  other.flying = running.together.flying;
  for (int k = 0; k < 4000; ++k) {
    running.together.step();
    other.step();
    ASSERT_EQ(copy.supervision().override_pct, running.board.supervision().override_pct) << k;
    ASSERT_EQ(copy.supervision().state, running.board.supervision().state) << k;
  }
}

TEST(Board, RefusesWhatCannotBe) {
  const auto scenario = committed_scenario("bench_lathe");
  firmware::Machine machine = scenario.machine;
  const firmware::BoardWiring wiring{
      .node = 1, .samples_by_can = true, .voltage_full_scale_v = 400, .current_full_scale_a = 100};
  ASSERT_TRUE(firmware::make_board(machine, wiring));
  auto other = wiring;
  other.node = 0;
  EXPECT_EQ(firmware::make_board(machine, other).error().board, Board::ConfigError::kNode);
  other.node = 128;
  EXPECT_EQ(firmware::make_board(machine, other).error().board, Board::ConfigError::kNode);
  other = wiring;
  other.voltage_full_scale_v = 0.0F;
  EXPECT_EQ(firmware::make_board(machine, other).error().board, Board::ConfigError::kAssembler);
  machine.force_limit_n = machine.force_reference_n;
  EXPECT_EQ(firmware::make_board(machine, wiring).error().board, Board::ConfigError::kForceLimit);
}

}  // namespace
}  // namespace cutforce::host_tests
