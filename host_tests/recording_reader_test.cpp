#include "hal/host/recording_reader.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "hal/host/replay_port.hpp"
#include "hal/host/truth_reader.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce {
namespace {

using hal::Sample;
using hal::Signal;
using hal::host::InputError;
using hal::host::RecordingReader;
using hal::host::Truth;
using hal::host::TruthReader;
using hal::host::TruthSignal;
using host_tests::ScratchFolder;

constexpr std::string_view kFirst = "# cutforce recording 1\n";
constexpr std::string_view kNames = "t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a\n";
constexpr std::string_view kRows = "0.000,1,2,3,4,5\n0.001,1,2,3,4,5\n";

std::string text_of(std::initializer_list<std::string_view> parts) {
  std::string text;
  for (const auto part : parts) text += part;
  return text;
}

std::string sound() { return text_of({kFirst, kNames, kRows}); }

std::expected<std::vector<Sample>, InputError> read_all(const std::filesystem::path& path,
                                                        std::size_t block = 100) {
  auto reader = RecordingReader::open(path);
  if (!reader) return std::unexpected{reader.error()};
  std::vector<Sample> all;
  std::vector<Sample> some(block);
  while (true) {
    const auto count = reader->read(some);
    if (!count) return std::unexpected{count.error()};
    if (*count == 0) return all;
    all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(*count));
  }
}

// A truth that a port could ask for must not compile.
template <class T>
concept GivesTruth = requires(T& reader, std::span<Sample> samples, std::span<Truth> truths) {
  reader.read(samples, truths);
};
static_assert(GivesTruth<TruthReader>);
static_assert(!GivesTruth<RecordingReader> && !GivesTruth<hal::host::ReplayPort>);

TEST(RecordingReader, PutsEveryColumnWhereItBelongs) {
  const ScratchFolder folder;
  const auto path = folder.write(
      "all.csv",
      text_of({kFirst, "# winding: delta\n# note: a: b\n# only a comment\n",
               "feed_mm_min,colour,true_cutting_force_n,t_s,v_wu_v,v_vw_v,v_uv_v,i_w_a,i_v_a,i_u_a,"
               "speed_rad_s,power_meter_w,measured_force_n,feed_active,override_pct,enable,"
               "part_start,workpiece_diameter_mm,drive_airgap_torque_nm,true_airgap_torque_nm,"
               "true_load_torque_nm,true_cutting_torque_nm\n",
               "120,red,9,0.000050,3,2,1,6,5,4,7,8,10,1,90,0,1,50,14,11,12,13\n"}));
  auto reader = RecordingReader::open(path);
  ASSERT_TRUE(reader) << reader.error().text();
  EXPECT_EQ(reader->voltage_kind(), hal::host::VoltageKind::kLineToLine);
  EXPECT_EQ(reader->columns().size(), 22U);
  EXPECT_EQ(reader->columns()[1], "colour");
  ASSERT_EQ(reader->metadata().size(), 2U);
  EXPECT_EQ(reader->metadata()[0], (hal::host::Metadata{"winding", "delta", 2}));
  EXPECT_EQ(reader->metadata()[1], (hal::host::Metadata{"note", "a: b", 3}));

  std::vector<Sample> block(3);
  ASSERT_EQ(reader->read(block).value(), 1U);
  const Sample& sample = block[0];
  EXPECT_EQ(sample.time_ns, 50'000);
  EXPECT_EQ(sample.voltage_v, (std::array{1.0F, 2.0F, 3.0F}));
  EXPECT_EQ(sample.current_a, (std::array{4.0F, 5.0F, 6.0F}));
  EXPECT_EQ(sample.speed_rad_s, 7.0F);
  EXPECT_EQ(sample.power_meter_w, 8.0F);
  EXPECT_EQ(sample.measured_force_n, 10.0F);
  EXPECT_EQ(sample.feed_active, 1.0F);
  EXPECT_EQ(sample.override_applied_pct, 90.0F);
  EXPECT_EQ(sample.enable, 0.0F);
  EXPECT_EQ(sample.part_start, 1.0F);
  EXPECT_EQ(sample.workpiece_diameter_m, 0.05F);
  EXPECT_EQ(sample.feed_m_s, 0.002F);
  EXPECT_EQ(sample.present, (1U << hal::kSignalCount) - 1U);
  EXPECT_EQ(reader->read(block).value(), 0U);
  EXPECT_EQ(reader->read(block).value(), 0U);

  auto with_truth = TruthReader::open(path);
  ASSERT_TRUE(with_truth);
  std::vector<Truth> truths(3);
  ASSERT_EQ(with_truth->read(block, truths).value(), 1U);
  EXPECT_EQ(truths[0].cutting_force_n, 9.0F);
  EXPECT_EQ(truths[0].airgap_torque_nm, 11.0F);
  EXPECT_EQ(truths[0].load_torque_nm, 12.0F);
  EXPECT_EQ(truths[0].cutting_torque_nm, 13.0F);
  EXPECT_EQ(truths[0].drive_airgap_torque_nm, 14.0F);
  EXPECT_TRUE(truths[0].has(TruthSignal::kDriveAirGapTorque));
  EXPECT_EQ(truths[0].present, 31U);
}

TEST(RecordingReader, DoesNotLetTruthChangeASample) {
  const ScratchFolder folder;
  const auto without = folder.write("without.csv", sound());
  const auto with = folder.write(
      "with.csv", text_of({kFirst, "true_load_torque_nm,t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a,",
                           "true_airgap_torque_nm,drive_airgap_torque_nm\n",
                           "7,0.000,1,2,3,4,5,8,9\n7,0.001,1,2,3,4,5,8,9\n"}));
  const auto a = read_all(without).value();
  const auto b = read_all(with).value();
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(std::memcmp(&a[i].voltage_v, &b[i].voltage_v, sizeof(Sample) - 16), 0);
    EXPECT_EQ(a[i].time_ns, b[i].time_ns);
    EXPECT_EQ(a[i].present, b[i].present);
  }
}

TEST(RecordingReader, TakesAnEmptyCellForAValueThatIsNotThere) {
  const ScratchFolder folder;
  const auto path =
      folder.write("gap.csv", text_of({kFirst, kNames, "0.000,1,,3,4,\n0.001,,,,,\n"}));
  const auto rows = read_all(path).value();
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_TRUE(rows[0].has(Signal::kVoltageU));
  EXPECT_FALSE(rows[0].has(Signal::kVoltageV));
  EXPECT_TRUE(rows[0].has(Signal::kCurrentU));
  EXPECT_FALSE(rows[0].has(Signal::kCurrentV));
  EXPECT_EQ(rows[1].present, 0U);
}

TEST(RecordingReader, AcceptsEveryHonestFormOfTheSameText) {
  const ScratchFolder folder;
  const std::string unix_text = sound();
  std::string windows_text = "\xEF\xBB\xBF";
  for (const char c : unix_text) windows_text += c == '\n' ? "\r\n" : std::string(1, c);
  const std::string spaced =
      text_of({kFirst, "\n",
               "t_s, v_un_v ,v_vn_v,v_wn_v,i_u_a,i_v_a\n0.000, 1,2 ,3,+4,5\n1e-3,1,2,3,4,5\n\n\n"});
  const std::string no_newline = unix_text.substr(0, unix_text.size() - 1);
  const std::string halves =
      host_tests::gzipped(unix_text.substr(0, 60)) + host_tests::gzipped(unix_text.substr(60));
  const auto expected = read_all(folder.write("unix.csv", unix_text)).value();
  ASSERT_EQ(expected.size(), 2U);
  for (const auto& [name, bytes] : {std::pair<std::string, std::string>{"windows", windows_text},
                                    {"spaced", spaced},
                                    {"no_newline", no_newline},
                                    {"gzip_by_content", host_tests::gzipped(unix_text)},
                                    {"two_members", halves}}) {
    SCOPED_TRACE(name);
    const auto rows = read_all(folder.write(name + ".csv", bytes));
    ASSERT_TRUE(rows) << rows.error().text();
    ASSERT_EQ(rows->size(), 2U);
    EXPECT_EQ((*rows)[1].time_ns, expected[1].time_ns);
    EXPECT_EQ((*rows)[1].current_a, expected[1].current_a);
  }
}

TEST(RecordingReader, GivesTheSameRowsInBlocksOfAnySize) {
  const ScratchFolder folder;
  std::string text = text_of({kFirst, kNames});
  for (int k = 0; k < 3000; ++k) text += std::to_string(k) + ",1,2,3,4,5\n";
  const auto path = folder.write("many.csv", text);
  for (const std::size_t block : {1U, 7U, 255U, 256U, 257U, 1000U, 5000U}) {
    const auto rows = read_all(path, block).value();
    ASSERT_EQ(rows.size(), 3000U) << block;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      ASSERT_EQ(rows[k].time_ns, static_cast<std::int64_t>(k) * 1'000'000'000);
    }
  }
}

struct Refusal {
  std::string name;
  std::string text;
  std::string place;  // after the file's name
  std::string what;   // part of it
};

std::vector<Refusal> refused_headers() {
  const auto names = [](std::string_view line) { return text_of({kFirst, line, "\n", kRows}); };
  return {
      {"empty file", "", ":1:1", "empty"},
      {"first line missing", text_of({kNames, kRows}), ":1:1", "first line"},
      {"wrong version", "# cutforce recording 2\n" + text_of({kNames, kRows}), ":1:22",
       "version '2'"},
      {"no version", "# cutforce recording\n", ":1:1", "first line"},
      {"ends after metadata", text_of({kFirst, "# winding: star\n"}), ":2:16", "ends before"},
      {"binary junk",
       std::string("\x7f"
                   "ELF\0\0",
                   6),
       ":1:1", "UTF-8"},
      {"UTF-16", std::string("\xFF\xFE#\0 \0", 6), ":1:1", "UTF-8"},
      {"junk in metadata", text_of({kFirst, "# note: \xFF\n", kNames, kRows}), ":2:9", "UTF-8"},
      {"header only", text_of({kFirst, kNames}), ":3:1", "no rows"},
      {"t_s missing", names("v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a"), ":2:1", "t_s is missing"},
      {"current missing", names("t_s,v_un_v,v_vn_v,v_wn_v,i_u_a"), ":2:1", "i_v_a is missing"},
      {"voltage missing", names("t_s,v_uv_v,v_wu_v,i_u_a,i_v_a"), ":2:1", "v_vw_v is missing"},
      {"all missing", names("a,b"), ":2:1", "t_s, v_un_v"},
      {"doubled", names("t_s,v_un_v,v_vn_v,v_un_v,v_wn_v,i_u_a,i_v_a"), ":2:19",
       "v_un_v is there twice"},
      {"doubled truth",
       names("t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a,true_load_torque_nm,true_load_torque_nm"),
       ":2:58", "twice"},
      {"time doubled", names("t_s,t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a"), ":2:5", "twice"},
      {"both units",
       names("t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a,workpiece_diameter_m,"
             "workpiece_diameter_mm"),
       ":2:59", "same value"},
      {"both kinds", names("t_s,v_un_v,v_vn_v,v_wn_v,v_uv_v,i_u_a,i_v_a"), ":2:26", "other kind"},
  };
}

std::vector<Refusal> refused_rows() {
  const auto row = [](std::string_view text) { return text_of({kFirst, kNames, kRows, text}); };
  return {
      {"text", row("0.002,1,2,abc,4,5\n"), ":5:11", "column v_wn_v: 'abc' is not a number"},
      {"unit", row("0.002,1,2,3 V,4,5\n"), ":5:11", "'3 V'"},
      {"nan", row("0.002,1,2,3,nan,5\n"), ":5:13", "column i_u_a: 'nan' is not a finite number"},
      {"inf", row("0.002,1,2,3,4,-inf\n"), ":5:15", "i_v_a"},
      {"too large", row("0.002,1,2,3,4,1e39\n"), ":5:15", "out of range"},
      {"time is text", row("now,1,2,3,4,5\n"), ":5:1", "column t_s: 'now'"},
      {"time is missing", row(",1,2,3,4,5\n"), ":5:1", "column t_s: is empty"},
      {"time is nan", row("nan,1,2,3,4,5\n"), ":5:1", "t_s"},
      {"time too large", row("1e20,1,2,3,4,5\n"), ":5:1", "out of range"},
      {"time repeated", row("0.001,1,2,3,4,5\n"), ":5:1", "0.001000 s is not after 0.001000 s"},
      {"time backwards", row("-1,1,2,3,4,5\n"), ":5:1", "-1.000000 s is not after"},
      {"few cells", row("0.002,1,2,3\n"), ":5:12", "4 cells where the header names 6"},
      {"cut last row", row("0.002,1,2"), ":5:10", "3 cells"},
      {"many cells", row("0.002,1,2,3,4,5,6\n"), ":5:16", "7 cells"},
      {"junk", row(std::string("0.002,1,\0\xFF,3,4,5\n", 17)), ":5:9", "v_vn_v"},
      {"empty line", row("\n0.002,1,2,3,4,5\n"), ":5:1", "line is empty"},
      {"comment between rows", row("# later\n"), ":5:1", "t_s"},
      {"long line", row(std::string(70'000, '1') + "\n"), ":5:65537", "64 KiB"},
      {"long line of cells", row("0.002" + std::string(70'000, ',') + "\n"), ":5:65537", "64 KiB"},
  };
}

TEST(RecordingReader, RefusesBadInputNamingItsPlace) {
  const ScratchFolder folder;
  auto cases = refused_headers();
  for (auto& more : refused_rows()) cases.push_back(std::move(more));
  for (const auto& [name, text, place, what] : cases) {
    for (const bool gzip : {false, true}) {
      SCOPED_TRACE(name + (gzip ? " (gzip)" : ""));
      const auto path = folder.write("bad.csv", gzip ? host_tests::gzipped(text) : text);
      const auto rows = read_all(path);
      ASSERT_FALSE(rows);
      EXPECT_EQ(rows.error().where, path.string() + place);
      EXPECT_NE(rows.error().what.find(what), std::string::npos) << rows.error().what;
      EXPECT_FALSE(rows.error().remedy.empty());
    }
  }
}

TEST(RecordingReader, RefusesJunkEvenInAColumnThatItIgnores) {
  const ScratchFolder folder;
  const auto path =
      folder.write("bad.csv", text_of({kFirst, "note,t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a\n",
                                       "\xC2\xB5m,0,1,2,3,4,5\nab\xFF,1,1,2,3,4,5\n"}));
  EXPECT_EQ(read_all(path).error().where, path.string() + ":4:3");
}

TEST(RecordingReader, DeliversTheRowsBeforeAFaultAndThenKeepsToTheFault) {
  const ScratchFolder folder;
  std::string text = text_of({kFirst, kNames});
  for (int k = 0; k < 1000; ++k) text += std::to_string(k) + ",1,2,3,4,5\n";
  text += "1000,1,2,x,4,5\n1001,1,2,3,4,5\n";
  auto reader = RecordingReader::open(folder.write("late.csv", text));
  ASSERT_TRUE(reader);
  std::vector<Sample> block(4000);
  EXPECT_EQ(reader->read(block).value(), 1000U);
  for (int k = 0; k < 3; ++k) {
    const auto after = reader->read(block);
    ASSERT_FALSE(after);
    EXPECT_TRUE(after.error().where.ends_with("late.csv:1003:10"));
  }
}

TEST(RecordingReader, NamesAFileThatCannotBeRead) {
  const ScratchFolder folder;
  EXPECT_EQ(read_all(folder.file("none.csv")).error().where, folder.file("none.csv").string());
  EXPECT_NE(read_all(folder.file("none.csv")).error().what.find("No such file"), std::string::npos);
  EXPECT_FALSE(read_all(folder.path()));
}

TEST(RecordingReader, TellsTheSamplePeriodFromRowsAndMetadata) {
  const ScratchFolder folder;
  const auto period_of = [&](std::string_view metadata, std::string_view rows) {
    return RecordingReader::open(
               folder.write("period.csv", text_of({kFirst, metadata, kNames, rows})))
        .value()
        .sample_period();
  };
  constexpr std::string_view kGap = "0,1,2,3,4,5\n0.1,1,2,3,4,5\n0.2,1,2,3,4,5\n9,1,2,3,4,5\n";
  EXPECT_DOUBLE_EQ(period_of("", kGap)->period_s, 0.1);
  EXPECT_DOUBLE_EQ(period_of("# sample_rate_hz: 10.1\n", kGap)->period_s, 1.0 / 10.1);
  // Declared against the rows: the rows are what there is.
  EXPECT_DOUBLE_EQ(period_of("# sample_rate_hz: 5000\n", kGap)->period_s, 0.1);
  EXPECT_DOUBLE_EQ(period_of("# sample_rate_hz: 5000\n", kGap)->declared_s, 0.0002);
  EXPECT_DOUBLE_EQ(period_of("# sample_rate_hz: 5000\n", "0,1,2,3,4,5\n")->period_s, 0.0002);
  EXPECT_FALSE(period_of("", "0,1,2,3,4,5\n"));
  for (const auto* const bad :
       {"# sample_rate_hz: fast\n", "# sample_rate_hz: 0\n", "# sample_rate_hz: -5\n",
        "# sample_rate_hz: nan\n", "# sample_rate_hz:\n", "# sample_rate_hz: 5,6\n"}) {
    const auto period = period_of(bad, kGap);
    ASSERT_FALSE(period) << bad;
    EXPECT_TRUE(period.error().where.ends_with("period.csv:2:3"));
  }
}

TEST(ReplayPort, PassesCommandsOnAndKeepsTheFirstError) {
  const ScratchFolder folder;
  const auto path = folder.write("bad.csv", sound() + "0.002,1,2,3,4,nan\n");
  std::vector<hal::Command> commands;
  hal::host::ReplayPort port(RecordingReader::open(path).value(),
                             [&](const hal::Command& command) { commands.push_back(command); });
  std::vector<Sample> block(1);
  EXPECT_EQ(port.read(block).value(), 1U);
  EXPECT_TRUE(
      port.write({.time_ns = 5, .override_pct = 90, .override_code = 1, .controlling = true}));
  EXPECT_EQ(port.read(block).value(), 1U);
  EXPECT_FALSE(port.error());
  EXPECT_EQ(port.read(block).error(), hal::PortError::kMalformed);
  EXPECT_EQ(port.read(block).error(), hal::PortError::kMalformed);
  EXPECT_TRUE(port.error()->where.ends_with("bad.csv:5:15"));
  ASSERT_EQ(commands.size(), 1U);
  EXPECT_EQ(commands[0].override_pct, 90);
}

TEST(RecordingReader, ReadsEverySharedRecording) {
  const char* const named = std::getenv("CUTFORCE_SHARED");
  const std::filesystem::path shared = named != nullptr ? named : CUTFORCE_SOURCE_DIR "/../shared";
  if (!std::filesystem::exists(shared / "recordings")) GTEST_SKIP() << "no shared recordings here";
  std::size_t recordings = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(shared / "recordings")) {
    if (!entry.path().string().ends_with(".csv.gz")) continue;
    SCOPED_TRACE(entry.path());
    auto reader = RecordingReader::open(entry.path());
    if (!reader && reader.error().what.find("first line") != std::string::npos)
      continue;  // a table
    ASSERT_TRUE(reader) << reader.error().text();
    EXPECT_TRUE(reader->sample_period());
    EXPECT_GT(read_all(entry.path(), 1024).value().size(), 1000U);
    ++recordings;
  }
  EXPECT_GT(recordings, 0U);
}

}  // namespace
}  // namespace cutforce
