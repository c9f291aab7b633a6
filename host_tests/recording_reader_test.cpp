#include "hal/host/recording_reader.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hal/host/replay_port.hpp"
#include "hal/host/truth_reader.hpp"
#include "support/recording_text.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce {
namespace {

using hal::Sample;
using hal::Signal;
using hal::host::RecordingReader;
using hal::host::Truth;
using hal::host::TruthReader;
using hal::host::TruthSignal;
using host_tests::kFirst;
using host_tests::kNames;
using host_tests::read_all;
using host_tests::ScratchFolder;
using host_tests::sound_recording;
using host_tests::text_of;

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
  const auto without = folder.write("without.csv", sound_recording());
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
  const std::string unix_text = sound_recording();
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
