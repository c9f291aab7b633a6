#include "firmware/linux/trace_folder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "firmware/linux/ring.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::firmware::board {
namespace {

namespace fs = std::filesystem;
constexpr std::int64_t kSecond_ns = 1'000'000'000;

LoopOutput row_at(std::int64_t time_ns) {
  LoopOutput row{};
  row.time_ns = time_ns;
  row.control_tick = true;
  return row;
}

std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    names.push_back(entry.path().filename().string());
  }
  std::ranges::sort(names);
  return names;
}

struct Folder {
  host_tests::ScratchFolder scratch;
  std::vector<std::string> said;

  TraceFolder open(std::uint32_t keep = 3) {
    return TraceFolder({.folder = scratch.path(),
                        .every_estimate = false,
                        .file_ns = 10 * kSecond_ns,
                        .keep = keep},
                       [this](const std::string& text) { said.push_back(text); });
  }
};

TEST(TraceFolder, BeginsANewFileInTimeAndKeepsTheNewest) {
  Folder folder;
  auto traces = folder.open();
  for (int k = 0; k < 100; ++k) traces.take(row_at(k * kSecond_ns));
  traces.close();
  EXPECT_EQ(traces.rows(), 100U);
  EXPECT_EQ(traces.lost(), 0U);
  EXPECT_EQ(names_in(folder.scratch.path()),
            (std::vector<std::string>{"trace-000008.csv.gz", "trace-000009.csv.gz",
                                      "trace-000010.csv.gz"}));
}

TEST(TraceFolder, GoesOnCountingAfterARestartAndClearsWhatAPowerCutLeft) {
  Folder folder;
  {
    auto traces = folder.open();
    traces.take(row_at(0));
    traces.close();
  }
  std::ofstream(folder.scratch.path() / "trace-000002.csv.gz.partial-0123abcd") << "half";
  std::ofstream(folder.scratch.path() / "notes.txt") << "a person's own";
  auto traces = folder.open();
  traces.take(row_at(0));
  traces.close();
  EXPECT_EQ(names_in(folder.scratch.path()),
            (std::vector<std::string>{"notes.txt", "trace-000001.csv.gz", "trace-000002.csv.gz"}));
}

TEST(TraceFolder, TakesEveryEstimateOnlyWhereItIsTold) {
  Folder folder;
  auto traces = folder.open();
  LoopOutput estimate = row_at(0);
  estimate.control_tick = false;
  traces.take(estimate);
  traces.close();
  EXPECT_TRUE(names_in(folder.scratch.path()).empty());
}

// A file in the place of the folder: nothing can be written there, not even by root.
TEST(TraceFolder, SaysOnceThatNothingCanBeWrittenAndCountsWhatIsLost) {
  Folder folder;
  const fs::path blocked = folder.scratch.path() / "blocked";
  std::ofstream(blocked) << "a file";
  std::vector<std::string> said;
  TraceFolder traces({.folder = blocked, .every_estimate = false, .file_ns = kSecond_ns, .keep = 3},
                     [&said](const std::string& text) { said.push_back(text); });
  for (int k = 0; k < 100; ++k) traces.take(row_at(k * kSecond_ns));
  traces.close();
  EXPECT_EQ(traces.rows(), 0U);
  EXPECT_EQ(traces.lost(), 100U);
  ASSERT_EQ(said.size(), 1U);
  EXPECT_NE(said.front().find("blocked"), std::string::npos);
}

TEST(Ring, HandsEverythingOverInOrderBetweenTwoThreads) {
  static Ring<std::uint64_t, 64> ring;
  constexpr std::uint64_t kMany = 200'000;
  std::uint64_t wrong = 0;
  std::uint64_t got = 0;
  std::uint64_t last = 0;
  std::atomic<bool> done{false};
  std::thread reader([&] {
    for (std::uint64_t value = 0;;) {
      const bool finished = done.load();
      if (ring.pop(value)) {
        wrong += value <= last ? 1U : 0U;
        last = value;
        ++got;
      } else if (finished) {
        return;
      }
    }
  });
  for (std::uint64_t k = 1; k <= kMany; ++k) ring.push(k);
  done.store(true);
  reader.join();
  EXPECT_EQ(wrong, 0U);
  EXPECT_EQ(got + ring.dropped(), kMany);
  EXPECT_GT(got, 0U);
}

TEST(Ring, DropsTheNewAndCountsItWhereThereIsNoRoom) {
  Ring<int, 4> ring;
  for (int k = 0; k < 10; ++k) ring.push(k);
  EXPECT_EQ(ring.dropped(), 6U);
  int value = -1;
  for (int k = 0; k < 4; ++k) {
    ASSERT_TRUE(ring.pop(value));
    EXPECT_EQ(value, k);
  }
  EXPECT_FALSE(ring.pop(value));
}

}  // namespace
}  // namespace cutforce::firmware::board
