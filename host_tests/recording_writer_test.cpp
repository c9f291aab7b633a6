#include "hal/host/recording_writer.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "hal/host/recording_reader.hpp"
#include "hal/host/truth_reader.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce {
namespace {

using hal::Sample;
using hal::Signal;
using hal::host::InputError;
using hal::host::RecordingLayout;
using hal::host::RecordingWriter;
using hal::host::Truth;
using hal::host::TruthReader;
using hal::host::VoltageKind;
using host_tests::ScratchFolder;

constexpr std::uint32_t kAllSignals = (1U << hal::kSignalCount) - 1U;
constexpr std::uint32_t kAllTruths = (1U << 5U) - 1U;
constexpr std::uint32_t kAlways = 0b11111U;  // three voltages, two currents

struct Rows {
  std::vector<Sample> samples;
  std::vector<Truth> truths;

  friend bool operator==(const Rows& a, const Rows& b) {
    const auto same = [](const auto& x, const auto& y) {
      return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof x[0]) == 0;
    };
    return same(a.samples, b.samples) && same(a.truths, b.truths);
  }
};

// Any finite bits, a fifth of the values absent; memset so that padding compares equal.
Rows random_rows(std::size_t count, const RecordingLayout& layout, std::mt19937_64& random) {
  Rows rows;
  std::int64_t time_ns = -5'000'000'000;
  const auto fill = [&](const hal::host::Column& column, Sample& sample, Truth& truth) {
    const auto mask =
        column.role == hal::host::ColumnRole::kSample ? layout.signals | kAlways : layout.truths;
    auto value = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
    // Converted units lose the last bits of subnormal numbers and of those near the end.
    if (!std::isfinite(value) || std::fabs(value) > 1e33F || std::fabs(value) < 1e-30F)
      value = 3.3F;
    if ((mask & bit(column)) == 0 || random() % 5 == 0) return;
    std::memcpy(field(column, sample, truth), &value, sizeof value);
    (column.role == hal::host::ColumnRole::kSample ? sample.present : truth.present) |= bit(column);
  };
  for (std::size_t k = 0; k < count; ++k) {
    Sample sample;
    Truth truth;
    std::memset(static_cast<void*>(&sample), 0, sizeof sample);
    std::memset(static_cast<void*>(&truth), 0, sizeof truth);
    time_ns += 1 + static_cast<std::int64_t>(random() >> (34 + random() % 30));
    sample.time_ns = time_ns;
    std::uint32_t done = 0;
    for (const auto& column : hal::host::known_columns()) {
      const bool is_sample = column.role == hal::host::ColumnRole::kSample;
      if (column.role == hal::host::ColumnRole::kTime) continue;
      if (is_sample && (done & bit(column)) != 0) continue;  // its other name
      if (is_sample) done |= bit(column);
      fill(column, sample, truth);
    }
    rows.samples.push_back(sample);
    rows.truths.push_back(truth);
  }
  return rows;
}

void write_rows(const std::filesystem::path& path, const RecordingLayout& layout,
                const Rows& rows) {
  auto writer = RecordingWriter::create(path, layout);
  ASSERT_TRUE(writer) << writer.error().text();
  ASSERT_TRUE(writer->write(rows.samples, rows.truths));
  ASSERT_TRUE(writer->finish());
}

std::expected<Rows, InputError> read_rows(const std::filesystem::path& path,
                                          std::size_t block = 777) {
  auto reader = TruthReader::open(path);
  if (!reader) return std::unexpected{reader.error()};
  Rows rows;
  std::vector<Sample> samples(block);
  std::vector<Truth> truths(block);
  while (true) {
    const auto count = reader->read(samples, truths);
    if (!count) return std::unexpected{count.error()};
    if (*count == 0) return rows;
    const auto n = static_cast<std::ptrdiff_t>(*count);
    rows.samples.insert(rows.samples.end(), samples.begin(), samples.begin() + n);
    rows.truths.insert(rows.truths.end(), truths.begin(), truths.begin() + n);
  }
}

RecordingLayout full_layout() {
  return {.metadata = {{"winding", "star", 2}, {"note", "a: b, \xC2\xB5m", 9}},
          .voltage_kind = VoltageKind::kLineToLine,
          .signals = kAllSignals,
          .truths = kAllTruths};
}

TEST(RecordingWriter, LosesNoBitInAnyFormAndFromFormToForm) {
  const ScratchFolder folder;
  std::mt19937_64 random(3);
  for (int round = 0; round < 24; ++round) {
    RecordingLayout layout = full_layout();
    if (round > 2) {
      layout.signals = static_cast<std::uint32_t>(random()) & kAllSignals;
      layout.truths = static_cast<std::uint32_t>(random()) & kAllTruths;
      layout.voltage_kind =
          random() % 2 == 0 ? VoltageKind::kLineToLine : VoltageKind::kLineToNeutral;
    }
    // Around the block size of the binary form, too.
    const std::array<std::size_t, 5> sizes{1, 4095, 4096, 4097, 50};
    const auto rows =
        random_rows(sizes[static_cast<std::size_t>(round) % sizes.size()], layout, random);
    auto previous = folder.file("first.csv");
    write_rows(previous, layout, rows);
    for (const auto* const name : {"a.cfr", "b.csv.gz", "c.cfr.gz", "d.csv"}) {
      const auto next = folder.file(name);
      ASSERT_TRUE(hal::host::convert_recording(previous, next));
      const auto read = read_rows(next, 1 + random() % 5000);
      ASSERT_TRUE(read) << read.error().text();
      ASSERT_TRUE(*read == rows) << name << " in round " << round;
      previous = next;
    }
    EXPECT_EQ(host_tests::bytes_of(previous), host_tests::bytes_of(folder.file("first.csv")));
  }
}

TEST(RecordingWriter, KeepsWhatIsWrittenAboutTheRows) {
  const ScratchFolder folder;
  std::mt19937_64 random(4);
  write_rows(folder.file("a.csv"), full_layout(), random_rows(3, full_layout(), random));
  const auto text = TruthReader::open(folder.file("a.csv")).value().info();
  ASSERT_TRUE(hal::host::convert_recording(folder.file("a.csv"), folder.file("a.cfr")));
  const auto binary = TruthReader::open(folder.file("a.cfr")).value().info();
  EXPECT_EQ(binary.metadata, text.metadata);
  EXPECT_EQ(binary.columns, text.columns);
  EXPECT_EQ(binary.voltage_kind, VoltageKind::kLineToLine);
  EXPECT_EQ(binary.signals, kAllSignals);
  EXPECT_EQ(binary.truths, kAllTruths);
}

TEST(RecordingWriter, WritesTextThatAPersonWouldHaveWritten) {
  const ScratchFolder folder;
  Sample sample{};
  sample.time_ns = 50'000;
  sample.voltage_v = {1.5F, std::numeric_limits<float>::quiet_NaN(), -3.0F};
  sample.current_a = {0.1F, 0.2F, 0.0F};
  sample.feed_m_s = 0.002F;
  sample.workpiece_diameter_m = 0.05F;
  sample.present = kAlways | bit(Signal::kFeedRate) | bit(Signal::kWorkpieceDiameter);
  auto writer = RecordingWriter::create(
      folder.file("a.csv"),
      {.metadata = {{"winding", "star", 0}},
       .voltage_kind = VoltageKind::kLineToNeutral,
       .signals = bit(Signal::kFeedRate) | bit(Signal::kWorkpieceDiameter) | bit(Signal::kSpeed),
       .truths = bit(hal::host::TruthSignal::kLoadTorque)});
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->write(std::span(&sample, 1)));
  ASSERT_TRUE(writer->finish());
  EXPECT_EQ(host_tests::bytes_of(folder.file("a.csv")),
            "# cutforce recording 1\n# winding: star\n"
            "t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a,speed_rad_s,workpiece_diameter_m,feed_mm_min,"
            "true_load_torque_nm\n"
            "0.000050,1.5,,-3,0.1,0.2,,0.05,120,\n");
}

TEST(RecordingWriter, LeavesNothingBehindUnlessFinished) {
  const ScratchFolder folder;
  std::mt19937_64 random(5);
  const auto rows = random_rows(5000, full_layout(), random);
  for (const auto* const name : {"a.csv", "a.csv.gz", "a.cfr"}) {
    folder.write(name, "what was there before");
    {
      auto writer = RecordingWriter::create(folder.file(name), full_layout());
      ASSERT_TRUE(writer);
      ASSERT_TRUE(writer->write(rows.samples, rows.truths));
      EXPECT_EQ(folder.file_count(), 2U);
    }
    EXPECT_EQ(folder.file_count(), 1U);
    EXPECT_EQ(host_tests::bytes_of(folder.file(name)), "what was there before");
    write_rows(folder.file(name), full_layout(), rows);
    EXPECT_EQ(folder.file_count(), 1U);
    EXPECT_TRUE(read_rows(folder.file(name)));
    std::filesystem::remove(folder.file(name));
  }
  // A conversion that fails on the way.
  folder.write(
      "bad.csv", "# cutforce recording 1\nt_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a\n" + [] {
        std::string text;
        for (int k = 0; k < 5000; ++k) text += std::to_string(k) + ",1,2,3,4,5\n";
        return text;
      }() + "5000,x,2,3,4,5\n");
  const auto converted = hal::host::convert_recording(folder.file("bad.csv"), folder.file("b.cfr"));
  ASSERT_FALSE(converted);
  EXPECT_TRUE(converted.error().where.ends_with("bad.csv:5003:6"));
  EXPECT_EQ(folder.file_count(), 1U);
}

TEST(RecordingWriter, WritesThroughALinkAndNeverReplacesADevice) {
  const ScratchFolder folder;
  std::mt19937_64 random(6);
  const auto rows = random_rows(5, full_layout(), random);
  folder.write("real.csv", "");
  std::filesystem::create_symlink(folder.file("real.csv"), folder.file("link.csv"));
  write_rows(folder.file("link.csv"), full_layout(), rows);
  EXPECT_TRUE(std::filesystem::is_symlink(folder.file("link.csv")));
  EXPECT_TRUE(read_rows(folder.file("real.csv")));

  std::filesystem::create_symlink("/dev/null", folder.file("null.csv"));
  write_rows(folder.file("null.csv"), full_layout(), rows);
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
  EXPECT_TRUE(std::filesystem::is_symlink(folder.file("null.csv")));
}

TEST(RecordingWriter, SaysWhyAFileCannotBeWritten) {
  const ScratchFolder folder;
  EXPECT_FALSE(RecordingWriter::create(folder.file("none") / "a.csv", full_layout()));
  EXPECT_FALSE(RecordingWriter::create(folder.path(), full_layout()));
  for (const auto& [key, value] : {std::pair<std::string, std::string>{"a:b", "c"},
                                   {"a", "two\nlines"},
                                   {"a", " spaced"},
                                   {"a", "\xFF"}}) {
    RecordingLayout layout = full_layout();
    layout.metadata = {{key, value, 0}};
    EXPECT_FALSE(RecordingWriter::create(folder.file("a.csv"), layout)) << value;
  }
  EXPECT_EQ(folder.file_count(), 0U);
  if (std::filesystem::exists("/dev/full")) {
    auto writer = RecordingWriter::create("/dev/full", full_layout());
    Sample sample{};
    const bool failed = !writer || !writer->write(std::span(&sample, 1)) || !writer->finish();
    EXPECT_TRUE(failed);
    EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
  }
}

TEST(RecordingWriter, RefusesTimeThatDoesNotIncrease) {
  const ScratchFolder folder;
  auto writer = RecordingWriter::create(folder.file("a.csv"), full_layout());
  const std::array<Sample, 2> samples{};
  EXPECT_FALSE(writer->write(samples));
}

TEST(BinaryRecording, RefusesDamageToAnyByteAndACutAnywhere) {
  const ScratchFolder folder;
  std::mt19937_64 random(8);
  RecordingLayout layout = full_layout();
  write_rows(folder.file("a.cfr"), layout, random_rows(20, layout, random));
  const std::string sound = host_tests::bytes_of(folder.file("a.cfr"));
  ASSERT_TRUE(read_rows(folder.file("a.cfr")));
  for (std::size_t i = 0; i < sound.size(); ++i) {
    std::string damaged = sound;
    damaged[i] = static_cast<char>(damaged[i] ^ (1 << (random() % 8)));
    const auto read = read_rows(folder.write("b.cfr", damaged));
    ASSERT_FALSE(read) << "byte " << i;
    ASSERT_NE(read.error().where.find("b.cfr:"), std::string::npos);
    const auto cut = read_rows(folder.write("b.cfr", sound.substr(0, i)));
    ASSERT_FALSE(cut) << "cut at " << i;
  }
  EXPECT_FALSE(read_rows(folder.write("b.cfr", sound + "x")));
}

}  // namespace
}  // namespace cutforce
