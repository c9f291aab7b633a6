// Recordings that no honest program wrote: whatever comes in, the answer is rows or a place.

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <array>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <random>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "hal/host/recording_reader.hpp"
#include "hal/host/recording_writer.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce {
namespace {

using hal::Sample;
using hal::host::RecordingReader;
using host_tests::ScratchFolder;

std::string small_recording() {
  std::string text =
      "# cutforce recording 1\n# winding: star\n# sample_rate_hz: 1000\n"
      "t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a,note,speed_rad_s,true_load_torque_nm\n";
  for (int k = 0; k < 8; ++k) {
    text += "0.00" + std::to_string(k) + ",1.5,-22.25,3e1,0.004,-5.0,ok,157.08,2.5\n";
  }
  return text;
}

std::string mutated(std::string bytes, std::mt19937& random) {
  constexpr std::string_view kNasty =
      "\n\r,,.-+eEnNaif#:;\"\t \0\xFF\x80"
      "019";
  const auto place = [&] { return bytes.empty() ? 0 : random() % bytes.size(); };
  for (auto edits = 1 + random() % 4; edits > 0 && !bytes.empty(); --edits) {
    switch (random() % 6) {
      case 0:
        bytes[place()] = static_cast<char>(random());
        break;
      case 1:
        bytes[place()] = kNasty[random() % kNasty.size()];
        break;
      case 2:
        bytes.insert(place(), 1, kNasty[random() % kNasty.size()]);
        break;
      case 3:
        bytes.erase(place(), 1 + random() % 20);
        break;
      case 4:
        bytes.resize(place());
        break;
      default:
        bytes.insert(place(), bytes.substr(place(), random() % 60));
        break;
    }
  }
  return bytes;
}

// Rows, or an error that says where, what and what to do.
void expect_rows_or_a_place(const std::filesystem::path& path) {
  const auto expect_told = [&](const hal::host::InputError& error) {
    ASSERT_TRUE(error.where.starts_with(path.string())) << error.text();
    ASSERT_FALSE(error.what.empty());
    ASSERT_FALSE(error.remedy.empty());
  };
  auto reader = RecordingReader::open(path);
  if (!reader) return expect_told(reader.error());
  if (const auto period = reader->sample_period(); !period) expect_told(period.error());
  std::array<Sample, 3> block;
  std::int64_t last_ns = INT64_MIN;
  while (true) {
    const auto count = reader->read(block);
    if (!count) return expect_told(count.error());
    if (*count == 0) return;
    for (const Sample& sample : std::span(block).first(*count)) {
      ASSERT_GT(sample.time_ns, last_ns);
      last_ns = sample.time_ns;
      for (const float value : sample.voltage_v) ASSERT_TRUE(std::isfinite(value));
    }
  }
}

TEST(RecordingFuzz, TextEndsInRowsOrAPlace) {
  const ScratchFolder folder;
  const std::string sound = small_recording();
  std::mt19937 random(1);
  for (int k = 0; k < 10'000; ++k) {
    expect_rows_or_a_place(folder.write("fuzz.csv", mutated(sound, random)));
    if (HasFatalFailure()) FAIL() << "mutation " << k;
  }
}

TEST(RecordingFuzz, BinaryAndGzipEndInRowsOrAPlace) {
  const ScratchFolder folder;
  const auto text = folder.write("a.csv", small_recording());
  ASSERT_TRUE(hal::host::convert_recording(text, folder.file("a.cfr")));
  const std::string binary = host_tests::bytes_of(folder.file("a.cfr"));
  const std::string packed = host_tests::gzipped(small_recording());
  std::mt19937 random(2);
  for (int k = 0; k < 3'000; ++k) {
    expect_rows_or_a_place(folder.write("fuzz", mutated(k % 2 == 0 ? binary : packed, random)));
    if (HasFatalFailure()) FAIL() << "mutation " << k;
  }
}

// The check sums hide what is behind them from a mutation: mend them, and try what is behind.
TEST(RecordingFuzz, BinaryWithMendedCheckSumsEndsInRowsOrAPlace) {
  const ScratchFolder folder;
  const auto text = folder.write("a.csv", small_recording());
  ASSERT_TRUE(hal::host::convert_recording(text, folder.file("a.cfr")));
  const std::string sound = host_tests::bytes_of(folder.file("a.cfr"));
  const auto mend = [](std::string& bytes) {
    for (std::size_t at = 8; at + 8 <= bytes.size();) {
      std::uint32_t length = 0;
      std::memcpy(&length, bytes.data() + at + 4, sizeof length);
      if (length > bytes.size() || at + 8 + length + 4 > bytes.size()) return;
      const auto crc = static_cast<std::uint32_t>(
          crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data() + at), 8 + length));
      std::memcpy(bytes.data() + at + 8 + length, &crc, sizeof crc);
      at += 8 + length + 4;
    }
  };
  std::mt19937 random(3);
  for (int k = 0; k < 5'000; ++k) {
    std::string bytes = sound;
    for (auto edits = 1 + random() % 3; edits > 0; --edits) {
      bytes[8 + random() % (bytes.size() - 8)] = static_cast<char>(random());
    }
    mend(bytes);
    expect_rows_or_a_place(folder.write("fuzz.cfr", bytes));
    if (HasFatalFailure()) FAIL() << "mutation " << k;
  }
}

TEST(RecordingFuzz, ATruncatedGzipIsToldWithTheLineReached) {
  const ScratchFolder folder;
  std::string text = small_recording();
  std::mt19937 random(4);
  for (int k = 8; k < 3000; ++k) {
    text += std::to_string(k) + "," + std::to_string(random() % 1000) + ",1,2,3,4,,5,6\n";
  }
  const std::string packed = host_tests::gzipped(text);
  for (int k = 0; k < 150; ++k) {
    const std::size_t length = k == 0 ? packed.size() - 1 : 20 + random() % (packed.size() - 20);
    const auto path = folder.write("cut.csv.gz", packed.substr(0, length));
    auto reader = RecordingReader::open(path);
    std::vector<Sample> block(100);
    std::size_t rows = 0;
    while (reader) {
      const auto count = reader->read(block);
      if (!count) reader = std::unexpected{count.error()};
      if (!count) break;
      ASSERT_NE(*count, 0U) << "a cut file ended as if it were whole, at " << length;
      rows += *count;
    }
    ASSERT_NE(reader.error().what.find("unexpected end of file"), std::string::npos);
    if (rows == 0) continue;
    const std::string line = ":" + std::to_string(rows + 5) + ":";  // four lines before the rows
    ASSERT_NE(reader.error().where.find(line), std::string::npos) << reader.error().where;
  }
}

// A gigabyte of one line from a pipe must be refused after a buffer of it: the writer is cut off.
TEST(RecordingFuzz, AnEndlessLineIsRefusedUnread) {
  const ScratchFolder folder;
  const auto path = folder.file("pipe");
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  std::signal(SIGPIPE, SIG_IGN);
  std::size_t written = 0;
  std::thread writer([&] {
    std::ofstream out(path, std::ios::binary);
    const std::string piece(64 * 1024, '1');
    while (out.write(piece.data(), static_cast<std::streamsize>(piece.size())) &&
           written < 1'000'000'000) {
      written += piece.size();
    }
  });
  {
    const auto reader = RecordingReader::open(path);
    ASSERT_FALSE(reader);
    EXPECT_EQ(reader.error().where, path.string() + ":1:65537");
  }
  writer.join();
  EXPECT_LT(written, 2'000'000U);
}

long peak_kib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

TEST(RecordingReader, NeedsNoMoreMemoryForALongRecording) {
  constexpr std::int64_t kBytes = 200'000'000;
  const ScratchFolder folder;
  const auto path = folder.file("pipe");
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  std::thread writer([&] {
    std::ofstream out(path, std::ios::binary);
    out << "# cutforce recording 1\nt_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a,i_w_a,speed_rad_s,"
           "power_meter_w\n";
    constexpr std::string_view kRest =
        ",  111.98,-55.9912,-55.9934,0.3859,-0.1929,-0.1929,157.0812,1234.01";
    std::string piece;
    std::int64_t sent = 0;
    for (std::int64_t k = 1; sent < kBytes; ++k) {
      (piece += std::to_string(k)).append(kRest).append("\n");
      if (piece.size() < 200'000) continue;
      out << piece;
      sent += static_cast<std::int64_t>(piece.size());
      piece.clear();
    }
  });
  auto reader = RecordingReader::open(path);
  ASSERT_TRUE(reader) << reader.error().text();
  std::vector<Sample> block(1024);
  std::size_t rows = reader->read(block).value() + reader->read(block).value();
  const long before_kib = peak_kib();
  while (const std::size_t count = reader->read(block).value()) rows += count;
  writer.join();
  EXPECT_GT(rows, 2'000'000U);
  EXPECT_LT(peak_kib() - before_kib, 4096);
}

}  // namespace
}  // namespace cutforce
