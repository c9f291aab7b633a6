// cutforce cnc as a person runs it, but for the bus: that is a board in this process.
#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "firmware/host/bench/bench_ports.hpp"
#include "firmware/host/commands/command.hpp"
#include "hal/can/messages.hpp"
#include "support/bench_board.hpp"
#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

using firmware::host::BenchPorts;
using firmware::host::CanLink;
using hal::can::Frame;

// The board's tick runs when the bench looks for frames: once a sample period.
class BoardInProcess final : public CanLink {
 public:
  std::expected<std::size_t, hal::PortError> receive(std::span<Frame> frames) override {
    const auto out = board_.tick(now_ns_, health());
    now_ns_ += 1'000'000;
    if (!out.frame) return 0U;
    board_.sent();
    if (const auto said = hal::can::unpack<hal::can::Override>(*out.frame);
        said && (out.frame->id & ~0x7FU) == static_cast<std::uint32_t>(hal::can::Base::kOverride)) {
      last_state = said->state;
    }
    frames[0] = *out.frame;
    return 1U;
  }
  std::expected<void, hal::SendError> send(const Frame& frame) override {
    static_cast<void>(board_.receive(frame, now_ns_));
    return {};
  }
  hal::BusStatus status() override { return health().bus; }

  static inline std::uint8_t last_state = 0;  // that the board has said, of all its runs

 private:
  static firmware::BoardHealth health() {
    firmware::BoardHealth health{};
    health.self_test_done = health.self_test_passed = health.ports_open = true;
    health.has_bus = true;
    health.bus = {.state = hal::BusState::kActive,
                  .acknowledged = true,
                  .restarts = 0,
                  .unsent = 0,
                  .overrun = 0,
                  .error_frames = 0};
    health.lines = {.acknowledged = true, .inhibit = false};
    return health;
  }

  firmware::Board board_ = board_of(committed_scenario("bench_lathe"));
  std::int64_t now_ns_ = 1'000'000'000;
};

class DeadBus final : public CanLink {
 public:
  std::expected<std::size_t, hal::PortError> receive(std::span<Frame>) override { return 0U; }
  std::expected<void, hal::SendError> send(const Frame&) override {
    return std::unexpected{hal::SendError::kNoRoom};
  }
  hal::BusStatus status() override { return {}; }
};

// A board's lines: each 50 ms another byte, and alive until it dies.
class LinesInProcess final : public firmware::host::LineLink {
 public:
  std::expected<std::size_t, hal::PortError> read(
      std::span<firmware::host::LineEvent> events) override {
    using Kind = firmware::host::LineEvent::Kind;
    std::size_t count = 0;
    const int k = step_++;
    if (k > 1000) return 0U;
    if (k % 20 == 0) events[count++] = {Kind::kAlive, static_cast<std::uint8_t>(k / 20 % 2)};
    if (k % 50 == 0) events[count++] = {Kind::kByte, static_cast<std::uint8_t>(60 + k / 50)};
    return count;
  }
  std::expected<void, hal::PortError> set_inhibit(bool active) override {
    inhibits += active ? 1 : -1;
    ++changes;
    return {};
  }

  static inline int inhibits = 0;
  static inline int changes = 0;

 private:
  int step_ = 0;
};

struct Printed {
  int exit_status;
  std::string text;
};

template <class Link>
Printed run_cnc(std::vector<std::string> arguments) {
  const BenchPorts ports{
      .open_can = [](const auto&) { return std::make_unique<Link>(); },
      .open_lines = [](const auto&) { return std::make_unique<LinesInProcess>(); },
      .paced = false};
  arguments.insert(arguments.begin(), {"cutforce", "cnc"});
  std::vector<const char*> argv;
  for (const auto& argument : arguments) argv.push_back(argument.c_str());
  testing::internal::CaptureStdout();
  const int status = firmware::host::run_program(static_cast<int>(argv.size()), argv.data(), ports);
  return {.exit_status = status, .text = testing::internal::GetCapturedStdout()};
}

std::string lathe() { return in_tests("scenarios/bench_lathe.toml").string(); }

TEST(Cnc, ClosesTheLoopAndWritesWhatItSaw) {
  const ScratchFolder folder;
  const auto trace = folder.file("bench.csv");
  const auto ran = run_cnc<BoardInProcess>(
      {"--can", "can0", "--lathe", lathe(), "--control", "--json", "--out", trace.string()});
  EXPECT_EQ(ran.exit_status, 0) << ran.text;
  const auto json = nlohmann::json::parse(ran.text);
  EXPECT_TRUE(json.at("held").get<bool>());
  EXPECT_EQ(json.at("figures").at("board"), "control");
  // Two steps of the override, as in Bench.HoldsTheForce...
  EXPECT_NEAR(json.at("figures").at("mean_n_at_1.5_mm").get<double>(), 500.0, 10.0);
  std::ifstream file(trace);
  std::string line;
  std::size_t lines = 0;
  while (std::getline(file, line)) ++lines;
  // Two lines of header; a row each 10 ms, both ends.
  EXPECT_EQ(lines, 2U + 1301U);
}

TEST(Cnc, HoldsAnotherForceWhereTheJobSaysSo) {
  const auto ran = run_cnc<BoardInProcess>(
      {"--can", "can0", "--lathe", lathe(), "--control", "--json", "--reference", "400"});
  EXPECT_EQ(ran.exit_status, 0) << ran.text;
  const auto json = nlohmann::json::parse(ran.text);
  EXPECT_NEAR(json.at("figures").at("mean_n_at_1.5_mm").get<double>(), 400.0, 10.0);
}

TEST(Cnc, GivesTheBoardBackInTheEndUnlessItIsToBeAbrupt) {
  using State = control::SupervisorState;
  const std::vector<std::string> arguments{"--can",     "can0",       "--lathe", lathe(),
                                           "--control", "--duration", "5"};
  EXPECT_EQ(run_cnc<BoardInProcess>(arguments).exit_status, 0);
  EXPECT_EQ(BoardInProcess::last_state, static_cast<std::uint8_t>(State::kReady));
  auto abrupt = arguments;
  abrupt.emplace_back("--abrupt");
  EXPECT_EQ(run_cnc<BoardInProcess>(abrupt).exit_status, 0);
  EXPECT_EQ(BoardInProcess::last_state, static_cast<std::uint8_t>(State::kControl));
}

TEST(Cnc, FollowsTheLinesAndDrivesInhibitForItsTime) {
  LinesInProcess::changes = LinesInProcess::inhibits = 0;
  const auto ran = run_cnc<DeadBus>({"--gpio", "chip", "--data", "0,1,2,3,4,5,6,7", "--strobe", "8",
                                     "--alive", "9", "--inhibit", "10", "--inhibit-at", "0.2",
                                     "--inhibit-for", "0.3", "--duration", "2", "--json"});
  EXPECT_EQ(ran.exit_status, 0) << ran.text;
  EXPECT_EQ(LinesInProcess::changes, 2);
  EXPECT_EQ(LinesInProcess::inhibits, 0);
  const auto json = nlohmann::json::parse(ran.text);
  EXPECT_EQ(json.at("figures").at("bytes"), 21);
  EXPECT_EQ(json.at("figures").at("cnc"), "feed_hold");
  EXPECT_NE(ran.text.find("inhibit line: on, control is forbidden"), std::string::npos);
  EXPECT_NE(ran.text.find("FEED HOLD, the board is silent"), std::string::npos);
}

TEST(Cnc, SaysThatNobodyIsThereAndFails) {
  const auto ran = run_cnc<DeadBus>({"--can", "can0", "--arm", "--wait", "0.5"});
  EXPECT_EQ(ran.exit_status, 1);
  EXPECT_NE(ran.text.find("The board was not heard."), std::string::npos) << ran.text;
}

TEST(Cnc, NamesTheRemedyForACommandLineThatCannotBe) {
  struct Case {
    const char* arguments;
    const char* remedy;
  };
  for (const auto& [arguments, remedy] : std::initializer_list<Case>{
           {"cnc", "--can IFACE"},
           {"cnc --lathe x.toml --gpio gpiochip0", "--can IFACE too"},
           {"cnc --gpio gpiochip0 --data 1,2,3", "--data 0,1,2"},
           {"cnc --gpio gpiochip0 --data 1,2,3,4 --strobe 5", "fanuc_ov_10"},
           {"cnc --gpio gpiochip0 --data 0,1,2,3,4,5,6,7", "--strobe 8"},
           {"cnc --can can0 --strobe 8", "--gpio CHIP"},
           {"cnc --gpio no-chip --data 0,1,2,3,4,5,6,7 --strobe 8", "gpiochip"},
           {"cnc --can can0 --latency 1.5", "whole milliseconds"},
           {"cnc --can can0 --timeout 5", "more than --latency"},
           {"cnc --can can0 --lathe missing.toml", "missing.toml"}}) {
    SCOPED_TRACE(arguments);
    const auto result = cutforce(arguments);
    EXPECT_EQ(result.exit_status, 2);
    EXPECT_NE(result.output.find(remedy), std::string::npos) << result.output;
  }
}

}  // namespace
}  // namespace cutforce::host_tests
