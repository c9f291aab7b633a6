// The whole wire in one process: the bench's lathe and CNC, quantised frames, and the board.
#include "firmware/host/bench/bench.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "firmware/host/bench/bench_log.hpp"
#include "support/bench_board.hpp"

namespace cutforce::host_tests {
namespace {

using firmware::host::Bench;
using firmware::host::BenchLathe;
using firmware::host::BenchLog;
using firmware::host::CncState;
using hal::can::Base;
using hal::can::Frame;

double figure(const BenchLog& log, const Bench& bench, const std::string& key) {
  for (const auto& entry : log.figures(bench)) {
    if (entry.key == key) return std::get<double>(entry.value);
  }
  ADD_FAILURE() << "there is no figure " << key;
  return NAN;
}

struct Ran {
  std::vector<std::uint8_t> overrides;  // in effect, each sample
  Bench bench;
  BenchLog log;
};

Ran run(const Bench::Config& config, std::function<void(BenchTogether&)> prepare = {},
        double duration_s = 13.0) {
  const auto scenario = committed_scenario("bench_lathe");
  Ran ran{.overrides = {}, .bench = bench_with(scenario, config), .log = {}};
  auto board = board_of(scenario);
  BenchTogether together{.bench = ran.bench, .board = board};
  if (prepare) prepare(together);
  while (ran.bench.now_ns() < static_cast<std::int64_t>(duration_s * 1e9)) {
    together.step();
    ran.log.note(ran.bench);
    ran.overrides.push_back(ran.bench.row().cnc.override_pct);
  }
  return ran;
}

// 14 bits, frames, the CNC's scan and the supervisor lie between plant and loop, and the force is
// held as in the plain simulation of the same file. 2 %: two steps of the override.
TEST(Bench, HoldsTheForceThroughQuantisedFramesAsThePlainSimulationDoes) {
  const auto ran = run(bench_config());
  const auto scenario = committed_scenario("bench_lathe");
  const auto rows = run_closed_loop(scenario, scenario.machine, scenario.duration_s);
  std::map<double, std::pair<double, double>> plain;  // of a depth: sum and count, of its end
  std::map<double, std::int64_t> begin_ns;
  for (const auto& row : rows) {
    const std::int64_t since_ns =
        begin_ns.try_emplace(row.truth.depth_m, row.truth.time_ns).first->second;
    if (row.truth.time_ns - since_ns < 1'500'000'000) continue;
    plain[row.truth.depth_m].first += row.truth.cutting_force_n;
    plain[row.truth.depth_m].second += 1.0;
  }
  for (const auto& [depth_m, at] : {std::pair{1e-3, "1"}, std::pair{1.5e-3, "1.5"}}) {
    const std::string key = std::string("_at_") + at + "_mm";
    const double mean_n = figure(ran.log, ran.bench, "mean_n" + key);
    const double plain_n = plain[depth_m].first / plain[depth_m].second;
    std::printf("[          ] %s mm: bench %.1f N (sd %.1f, peak %.0f), plain %.1f N\n", at, mean_n,
                figure(ran.log, ran.bench, "stddev_n" + key),
                figure(ran.log, ran.bench, "peak_n" + key), plain_n);
    EXPECT_NEAR(mean_n, 500.0, 10.0);
    EXPECT_NEAR(mean_n, plain_n, 10.0);
    EXPECT_LT(figure(ran.log, ran.bench, "stddev_n" + key), 10.0);
  }
  EXPECT_TRUE(ran.log.held(ran.bench));
  EXPECT_EQ(ran.bench.heard().counts.missing, 0U);
}

// What the board answers may come at any time within a scan of the CNC. 2 ms are the least gap
// between its frames, 3 more what a frame waits for others.
TEST(Bench, GivesTheSameOverridesHoweverTheAnswersJitter) {
  const auto at_once = run(bench_config());
  for (const unsigned seed : {1U, 2U}) {
    const auto late = run(bench_config(), [seed](BenchTogether& together) {
      together.delay_ns = [random = std::mt19937(seed)]() mutable {
        return std::int64_t{1000} * std::uniform_int_distribution<std::int64_t>(0, 5000)(random);
      };
    });
    EXPECT_EQ(at_once.overrides, late.overrides) << seed;
  }
}

TEST(Bench, FallsBackToFeedHoldWhereTheBoardFallsSilentInControlAndStaysThere) {
  const auto ran = run(bench_config(), [](BenchTogether& together) {
    const std::int64_t from_ns = together.clock_ns + 6'000'000'000;
    together.to_bench = [from_ns](Frame&, std::int64_t now_ns) {
      return now_ns < from_ns || now_ns > from_ns + 1'000'000'000;
    };
  });
  EXPECT_EQ(ran.bench.row().cnc.state, CncState::kFeedHold);
  EXPECT_EQ(ran.bench.cnc().silences, 1U);
  EXPECT_EQ(ran.bench.cnc().armings, 1U);
  // 250 ms after the last frame, which came up to 20 ms before the silence.
  EXPECT_NE(ran.overrides[6220], 0);
  EXPECT_EQ(ran.overrides[6275], 0);
  EXPECT_EQ(ran.overrides.back(), 0);
  EXPECT_NE(ran.log.verdict(ran.bench).find("FEED HOLD"), std::string::npos);
}

TEST(Bench, FallsBackToTheProgrammedFeedWhereTheBoardOnlyMonitored) {
  auto config = bench_config();
  config.cnc.control = false;
  const auto ran = run(
      config,
      [](BenchTogether& together) {
        const std::int64_t from_ns = together.clock_ns + 4'000'000'000;
        together.to_bench = [from_ns](Frame&, std::int64_t now_ns) { return now_ns < from_ns; };
      },
      6.0);
  EXPECT_EQ(ran.bench.row().cnc.state, CncState::kProgrammed);
  EXPECT_EQ(ran.overrides.back(), 100);
}

TEST(Bench, GivesControlAgainAfterAnOperatorHasAcknowledged) {
  auto config = bench_config();
  config.cnc.rearm = true;
  const auto ran = run(config, [](BenchTogether& together) {
    const std::int64_t from_ns = together.clock_ns + 6'000'000'000;
    together.to_bench = [from_ns](Frame&, std::int64_t now_ns) {
      return now_ns < from_ns || now_ns > from_ns + 1'000'000'000;
    };
  });
  EXPECT_EQ(ran.bench.row().cnc.state, CncState::kFollowing);
  EXPECT_EQ(ran.bench.cnc().armings, 2U);
  EXPECT_TRUE(ran.bench.heard().override->enabled);
}

// Another node with the board's identifiers costs an acknowledgement, not a restart.
TEST(Bench, GivesControlAgainAfterATwinOfTheBoardWasTakenAway) {
  auto config = bench_config();
  config.cnc.rearm = true;
  bool seen = false;
  const auto ran = run(config, [&seen](BenchTogether& together) {
    const std::int64_t from_ns = together.clock_ns + 4'000'000'000;
    auto& board = together.board;
    together.to_bench = [from_ns, &board, &seen](Frame&, std::int64_t now_ns) {
      if (now_ns > from_ns && now_ns < from_ns + 500'000'000) {
        static_cast<void>(board.receive(pack(hal::can::Heartbeat{.nmt_state = 5}, 1), now_ns));
      }
      seen = seen || board.supervision().reason == control::Reason::kForeign;
      return true;
    };
  });
  EXPECT_TRUE(seen);
  EXPECT_EQ(ran.bench.row().cnc.state, CncState::kFollowing);
  EXPECT_TRUE(ran.bench.heard().override->enabled);
}

TEST(Bench, CountsWhatIsWrongWithFramesByItsKind) {
  const auto ran = run(
      bench_config(),
      [](BenchTogether& together) {
        together.to_bench = [count = 0, last = Frame{}](Frame& frame, std::int64_t) mutable {
          if (frame.id != hal::can::identifier(Base::kOverride, 1)) return true;
          ++count;
          if (count == 50) frame.data[4] ^= 1U;  // a bit of the payload
          if (count == 60) frame = last;         // replayed
          if (count == 70) frame.length = 7;
          if (count == 80) return false;  // lost
          last = frame;
          return true;
        };
      },
      3.0);
  const auto& counts = ran.bench.heard().counts;
  EXPECT_EQ(counts.wrong_crc, 1U);
  EXPECT_EQ(counts.repeated, 1U);
  EXPECT_EQ(counts.malformed, 1U);
  EXPECT_GT(counts.jumped, 0U);
  // Of the one that was lost, and of the three that could not be read.
  EXPECT_EQ(counts.missing, 4U);
  EXPECT_EQ(ran.bench.row().cnc.state, CncState::kFollowing);
}

TEST(Bench, SendsSpindleBeforePhasesOfTheSameCountAndMachineStateEach20Ms) {
  const auto scenario = committed_scenario("bench_lathe");
  auto bench = bench_with(scenario, bench_config(), 2);
  std::map<std::uint32_t, int> count;
  for (int k = 0; k < 1000; ++k) {
    std::array<Frame, Bench::kMostFrames> frames;
    const std::size_t sent = bench.step(frames);
    ASSERT_GT(sent, 0U);
    const auto phases = hal::can::unpack<hal::can::Phases>(frames[sent - 1]);
    ASSERT_EQ(frames[sent - 1].id, hal::can::identifier(Base::kPhases, 1));
    EXPECT_EQ(phases->count, static_cast<std::uint8_t>(k));
    if (k % 2 == 0) {
      const auto spindle = hal::can::unpack<hal::can::Spindle>(frames[sent - 2]);
      ASSERT_EQ(frames[sent - 2].id, hal::can::identifier(Base::kSpindle, 1));
      EXPECT_EQ(spindle->count, phases->count);
    }
    for (std::size_t n = 0; n < sent; ++n) ++count[frames[n].id];
  }
  EXPECT_EQ(count[hal::can::identifier(Base::kMachineState, 1)], 50);
  EXPECT_EQ(count[hal::can::identifier(Base::kSpindle, 1)], 500);
  EXPECT_LE(count[hal::can::identifier(Base::kJob, 1)], 4);
}

// The plant has moved on by what the board could not see: neither is time invented nor a sample.
TEST(Bench, LeavesAGapInTheCountWhereTheSignalsHaveOne) {
  auto scenario = committed_scenario("bench_lathe");
  scenario.simulation.faults.push_back(
      {.kind = hal::host::SignalFaultKind::kGap, .begin_s = 0.1, .end_s = 0.15});
  auto bench = bench_with(scenario, bench_config());
  int phases = 0;
  for (int k = 0; k < 200; ++k) {
    std::array<Frame, Bench::kMostFrames> frames;
    const std::size_t sent = bench.step(frames);
    for (std::size_t n = 0; n < sent; ++n) {
      if (frames[n].id != hal::can::identifier(Base::kPhases, 1)) continue;
      ++phases;
      EXPECT_EQ(hal::can::unpack<hal::can::Phases>(frames[n])->count, static_cast<std::uint8_t>(k));
    }
  }
  EXPECT_EQ(phases, 150);
}

TEST(Bench, WaitsForTheBoardBeforeItsTimeBegins) {
  auto config = bench_config();
  config.wait_for_board = true;
  auto bench = bench_with(committed_scenario("bench_lathe"), config);
  std::array<Frame, Bench::kMostFrames> frames;
  for (int k = 0; k < 1234; ++k) {
    const std::size_t sent = bench.step(frames);
    for (std::size_t n = 0; n < sent; ++n) {
      EXPECT_NE(frames[n].id, hal::can::identifier(Base::kPhases, 1));
    }
  }
  EXPECT_EQ(bench.now_ns(), 0);
  bench.receive(hal::can::pack(hal::can::Heartbeat{.nmt_state = 127}, 1));
  for (int k = 0; k < 20; ++k) static_cast<void>(bench.step(frames));
  EXPECT_GT(bench.now_ns(), 0);
  EXPECT_LE(bench.now_ns(), 20'000'000);
}

TEST(Bench, FollowsAByteThatWasStrobedAndFallsBackWhenTheAliveLineStops) {
  using firmware::host::LineEvent;
  auto config = bench_config();
  config.by_lines = true;
  config.code = control::OverrideCode::kSiemensGray;
  auto bench = Bench::make(config, std::nullopt).value();
  std::array<Frame, Bench::kMostFrames> frames;
  const auto run_ms = [&](int time_ms, bool alive) {
    for (int k = 0; k < time_ms; ++k) {
      if (alive && k % 20 == 0) {
        bench.receive({LineEvent::Kind::kAlive, static_cast<std::uint8_t>(k / 20 % 2)});
      }
      static_cast<void>(bench.step(frames));
    }
  };
  bench.receive({LineEvent::Kind::kByte, control::encode(config.code, 63)});
  run_ms(100, true);
  EXPECT_EQ(bench.row().cnc.override_pct, 63);
  run_ms(300, false);
  EXPECT_EQ(bench.row().cnc.state, CncState::kFeedHold);
  EXPECT_EQ(bench.row().cnc.override_pct, 0);
}

TEST(Bench, TakesAStrobedByteForASignOfLifeWhereThereIsNoAliveLine) {
  using firmware::host::LineEvent;
  auto config = bench_config();
  config.by_lines = true;
  config.has_alive = false;
  config.wait_for_board = true;
  auto bench = Bench::make(config, std::nullopt).value();
  std::array<Frame, Bench::kMostFrames> frames;
  const auto run_ms = [&](int time_ms) {
    for (int k = 0; k < time_ms; ++k) static_cast<void>(bench.step(frames));
  };
  bench.receive({LineEvent::Kind::kAlarm, 1});
  run_ms(100);
  EXPECT_TRUE(bench.row().waiting);
  bench.receive({LineEvent::Kind::kByte, 40});
  run_ms(200);
  EXPECT_EQ(bench.row().cnc.override_pct, 40);
  bench.receive({LineEvent::Kind::kByte, 50});
  run_ms(200);
  EXPECT_EQ(bench.row().cnc.override_pct, 50);
  run_ms(100);
  EXPECT_EQ(bench.row().cnc.state, CncState::kFeedHold);
}

TEST(Bench, GivesTheBoardBackWhenItLeaves) {
  const auto scenario = committed_scenario("bench_lathe");
  auto bench = bench_with(scenario, bench_config());
  auto board = board_of(scenario);
  BenchTogether together{.bench = bench, .board = board};
  while (bench.now_ns() < 5'000'000'000) together.step();
  ASSERT_EQ(bench.heard().override->state,
            static_cast<std::uint8_t>(control::SupervisorState::kControl));
  bench.leave();
  for (int k = 0; k < 100; ++k) together.step();
  EXPECT_EQ(bench.heard().override->state,
            static_cast<std::uint8_t>(control::SupervisorState::kReady));
}

// Of the board, as it is told to stop: the CNC hears why, once, and then the silence that it waits
// for.
TEST(Bench, HearsWhyTheBoardEndsAndNothingAfterThat) {
  auto board = board_of(committed_scenario("bench_lathe"));
  firmware::BoardHealth health{};
  health.self_test_done = health.self_test_passed = health.ports_open = health.has_bus = true;
  health.bus = {.state = hal::BusState::kActive,
                .acknowledged = true,
                .restarts = 0,
                .unsent = 0,
                .overrun = 0,
                .error_frames = 0};
  std::vector<Frame> last;
  for (int k = 0; k < 1000; ++k) {
    health.stop = k >= 500;
    const auto out = board.tick(1'000'000'000 + k * 1'000'000, health);
    if (!out.frame) continue;
    board.sent();
    if (k >= 500) last.push_back(*out.frame);
    EXPECT_LT(k, 510) << "something after the end";
  }
  ASSERT_EQ(last.size(), 2U);
  const auto emergency = hal::can::unpack<hal::can::Emergency>(last[0]);
  ASSERT_TRUE(emergency && last[0].id == hal::can::identifier(Base::kEmergency, 1));
  EXPECT_EQ(emergency->reason, static_cast<std::uint8_t>(control::Reason::kStopped));
  ASSERT_EQ(last[1].id, hal::can::identifier(Base::kOverride, 1));
  EXPECT_EQ(last[1].data[4] & 0xF, static_cast<int>(control::SupervisorState::kDead));
  EXPECT_EQ(last[1].data[4] >> 4, static_cast<int>(control::Reason::kStopped));
}

TEST(Bench, RefusesWhatCannotBe) {
  auto config = bench_config();
  config.node = 0;
  EXPECT_EQ(Bench::make(config, std::nullopt).error().where, "--node");
  config = bench_config();
  config.cnc.scan_ns = 1'500'000;
  EXPECT_EQ(Bench::make(config, std::nullopt).error().where, "--latency");
  config = bench_config();
  config.cnc.timeout_ns = 5'000'000;
  EXPECT_EQ(Bench::make(config, std::nullopt).error().where, "--timeout");
  auto scenario = committed_scenario("bench_lathe");
  scenario.simulation.sample_rate_hz = 3000.0;
  EXPECT_NE(BenchLathe::make(scenario, 1, 1).error().where.find("sample_rate_hz"),
            std::string::npos);
  scenario.model = firmware::host::Model::kForce;
  EXPECT_NE(BenchLathe::make(scenario, 1, 1).error().what.find("motor"), std::string::npos);
}

}  // namespace
}  // namespace cutforce::host_tests
