// Golden replays: what the loop makes of each committed recording, and of two closed loops, must
// come out bit for bit in every build. host_tests/golden/ holds the traces at the control rate, as
// the program writes them, and hashes.txt one hash over every output at the estimate's rate.
// toolchain/rewrite_golden.sh writes them anew; the commit then has to explain the difference.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include "firmware/host/run/loop_recorder.hpp"
#include "firmware/parameter.hpp"
#include "support/bench_board.hpp"
#include "support/loop_support.hpp"
#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

namespace fs = std::filesystem;
using firmware::EstimatorName;
using firmware::LoopOutput;
using firmware::Machine;

constexpr std::array kEstimators{EstimatorName::kFused, EstimatorName::kSynthesized,
                                 EstimatorName::kComputed, EstimatorName::kMeasured};
const fs::path kFolder = in_tests("golden");

bool writes() { return std::getenv("CUTFORCE_WRITE_GOLDEN") != nullptr; }

std::string name_of(EstimatorName estimator) {
  return std::string(firmware::kNames<EstimatorName>[static_cast<std::size_t>(estimator)]);
}

std::string trace_of(const std::vector<LoopOutput>& outputs) {
  const ScratchFolder folder;
  auto recorder = firmware::host::LoopRecorder::create(folder.file("trace.csv"), {}).value();
  for (const LoopOutput& output : outputs) recorder.take(output);
  EXPECT_TRUE(recorder.finish());
  return bytes_of(folder.file("trace.csv"));
}

std::vector<std::string> lines_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

// The first line that differs says more than two whole files.
void expect_same_text(const std::string& got, const std::string& wanted, const fs::path& file) {
  if (got == wanted) return;
  const auto a = lines_of(got);
  const auto b = lines_of(wanted);
  std::size_t k = 0;
  while (k < a.size() && k < b.size() && a[k] == b[k]) ++k;
  ADD_FAILURE() << file.filename().string() << ", line " << k + 1 << "\n  is     "
                << (k < a.size() ? a[k] : "missing") << "\n  golden "
                << (k < b.size() ? b[k] : "missing")
                << "\ntoolchain/rewrite_golden.sh writes it anew, if this is meant";
}

void compare_trace(const std::string& name, const std::vector<LoopOutput>& outputs) {
  const fs::path file = kFolder / (name + ".csv");
  const std::string trace = trace_of(outputs);
  if (writes()) {
    std::ofstream(file, std::ios::binary) << trace;
  } else {
    expect_same_text(trace, bytes_of(file), file);
  }
}

std::map<std::string, std::string> read_hashes() {
  std::map<std::string, std::string> hashes;
  std::ifstream in(kFolder / "hashes.txt");
  for (std::string name, hash; in >> name >> hash;) hashes[name] = hash;
  return hashes;
}

void compare_hash(const std::string& name, const std::vector<LoopOutput>& outputs) {
  std::array<char, 17> text{};
  std::snprintf(text.data(), text.size(), "%016llx",
                static_cast<unsigned long long>(hash_of(outputs)));
  auto hashes = read_hashes();
  if (!writes()) {
    EXPECT_EQ(text.data(), hashes[name]) << name;
    return;
  }
  hashes[name] = text.data();
  std::ofstream out(kFolder / "hashes.txt", std::ios::binary);
  for (const auto& [key, hash] : hashes) out << key << ' ' << hash << '\n';
}

void compare(const std::string& name, const std::vector<LoopOutput>& outputs) {
  ASSERT_FALSE(outputs.empty());
  compare_trace(name, outputs);
  compare_hash(name, outputs);
}

TEST(Golden, ReplaysEveryCommittedRecordingBitForBit) {
  for (const std::string recording : kCommittedRecordings) {
    const Recorded recorded = committed_recording(recording);
    for (const EstimatorName estimator : kEstimators) {
      auto loop = firmware::make_loop(with_estimator(recorded.machine, estimator));
      ASSERT_TRUE(loop);
      compare(recording + "_" + name_of(estimator), run_over(*loop, recorded.samples));
    }
  }
}

void compare_closed_loop(const std::string& name, double duration_s) {
  const auto scenario = committed_scenario(name);
  std::vector<LoopOutput> outputs;
  for (const auto& row : run_closed_loop(scenario, scenario.machine, duration_s)) {
    outputs.push_back(row.output);
  }
  compare("closed_loop_" + name, outputs);
}

TEST(Golden, HoldsTheForceOverAStepInDepthBitForBit) { compare_closed_loop("demo_step", 8.0); }

TEST(Golden, LosesAPhaseInTheCutBitForBit) { compare_closed_loop("lost_phase", 7.0); }

// The board and its bench with the frames between them; host_tests/guest/board_loop_test.py
// compares what the service makes of the same bench over real drivers.
TEST(Golden, HoldsTheForceThroughFramesBitForBit) {
  const auto scenario = committed_scenario("bench_lathe");
  auto config = bench_config();
  config.wait_for_board = true;
  auto bench = bench_with(scenario, config);
  auto board = board_of(scenario);
  BenchTogether together{.bench = bench, .board = board};
  std::vector<LoopOutput> outputs;
  together.sink = [&outputs](const LoopOutput& row) { outputs.push_back(row); };
  while (bench.now_ns() <= 13'000'000'000) together.step();
  compare("closed_loop_bench_lathe", outputs);
}

// A file that no test compares with would go stale unseen.
TEST(Golden, HoldsNothingThatIsNotCompared) {
  if (writes()) GTEST_SKIP() << "the golden files are being written";
  const auto hashes = read_hashes();
  std::size_t traces = 0;
  for (const auto& entry : fs::directory_iterator(kFolder)) {
    if (entry.path().filename() == "hashes.txt") continue;
    ++traces;
    EXPECT_TRUE(hashes.contains(entry.path().stem().string())) << entry.path().filename();
  }
  EXPECT_EQ(traces, hashes.size());
  EXPECT_EQ(traces, kCommittedRecordings.size() * kEstimators.size() + 3);
}

}  // namespace
}  // namespace cutforce::host_tests
