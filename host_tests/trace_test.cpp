#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/host/trace_reader.hpp"
#include "firmware/host/trace_writer.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce {
namespace {

using firmware::LoopOutput;
using firmware::LoopState;
using firmware::Source;
using firmware::host::TraceReader;
using firmware::host::TraceWriter;
using host_tests::ScratchFolder;

constexpr std::string_view kHeader =
    "# cutforce trace 1\n"
    "t_s,airgap_power_w,measured_power_w,airgap_torque_nm,load_torque_nm,cutting_torque_nm,"
    "cutting_torque_sigma_nm,cutting_force_n,cutting_force_sigma_n,source,override_pct,state,"
    "fault\n";

std::expected<std::vector<LoopOutput>, hal::host::InputError> read_all(
    const std::filesystem::path& path, std::size_t block = 100) {
  auto reader = TraceReader::open(path);
  if (!reader) return std::unexpected{reader.error()};
  std::vector<LoopOutput> all;
  std::vector<LoopOutput> some(block);
  while (true) {
    const auto count = reader->read(some);
    if (!count) return std::unexpected{count.error()};
    if (*count == 0) return all;
    all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(*count));
  }
}

TEST(TraceWriter, WritesTheContractToTheLetter) {
  const ScratchFolder folder;
  LoopOutput output{};
  output.time_ns = 1'000'000;
  output.state = LoopState::kStarting;
  output.airgap_power_w = 5.0F;  // not present: must not be seen
  auto writer = TraceWriter::create(folder.file("a.csv"));
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->write(output));

  output.time_ns = 2'000'001;
  output.measured_power_w = 1234.5F;
  output.airgap_torque_nm = -0.25F;
  output.load_torque_nm = std::numeric_limits<float>::quiet_NaN();
  output.cutting_torque_nm = 1.0F;
  output.cutting_torque_sigma_nm = 0.1F;
  output.cutting_force_n = 50.0F;
  output.cutting_force_sigma_n = std::numeric_limits<float>::infinity();
  output.override_pct = 100.0F;
  output.present = 0x7FU;
  output.source = Source::kDynamometer;
  output.state = LoopState::kRefused;
  output.faults.insert(estimator::Fault::kClipped);
  output.faults.insert(estimator::Fault::kGap);
  ASSERT_TRUE(writer->write(output));
  ASSERT_TRUE(writer->finish());
  EXPECT_EQ(host_tests::bytes_of(folder.file("a.csv")),
            std::string(kHeader) + "0.001000,,,,,,,,,,,starting,\n" +
                "0.002000001,5,1234.5,-0.25,,1,0.1,50,,dynamometer,100,refused,gap|clipped\n");
}

TEST(TraceWriter, NamesEverySourceStateAndFault) {
  const ScratchFolder folder;
  auto writer = TraceWriter::create(folder.file("a.csv")).value();
  for (int k = 0; k < 5; ++k) {
    LoopOutput output{};
    output.time_ns = k;
    output.source = static_cast<Source>(k);
    output.state = static_cast<LoopState>(k);
    output.faults.bits = (1U << estimator::kFaultCount) - 1U;
    ASSERT_TRUE(writer.write(output));
  }
  ASSERT_TRUE(writer.finish());
  const std::string text = host_tests::bytes_of(folder.file("a.csv"));
  for (const auto* const part :
       {",,starting,", "measured,,no_estimate,", "computed,,air,", "fused,,cut,",
        "dynamometer,,refused,",
        "non_finite|out_of_range|time_order|gap|stuck_channel|lost_phase|phase_order|raw_pwm|"
        "clipped\n"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part;
  }
}

TEST(TraceWriter, LosesNoBitOnTheWayThroughText) {
  const ScratchFolder folder;
  std::mt19937_64 random(1);
  for (const auto* const name : {"a.csv", "a.csv.gz"}) {
    std::vector<LoopOutput> outputs(5000);
    std::int64_t time_ns = -100;
    for (LoopOutput& output : outputs) {
      output = LoopOutput{};
      output.time_ns = time_ns += 1 + static_cast<std::int64_t>(random() % 2'000'000);
      output.present = static_cast<std::uint32_t>(random()) & 0x7FU;
      output.source = static_cast<Source>(random() % 5);
      output.state = static_cast<LoopState>(random() % 5);
      output.faults.bits = random() % 3 == 0 ? static_cast<std::uint32_t>(random()) & 0x1FFU : 0U;
      for (const auto& column : firmware::host::kTraceColumns) {
        if (column.role != firmware::host::TraceRole::kNumber) continue;
        const auto value = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
        if ((output.present & column.present) == 0 || !std::isfinite(value)) continue;
        output.*column.number = value;
      }
    }
    auto writer = TraceWriter::create(folder.file(name)).value();
    ASSERT_TRUE(writer.write(outputs));
    ASSERT_TRUE(writer.finish());
    const auto read = read_all(folder.file(name), 333);
    ASSERT_TRUE(read) << read.error().text();
    ASSERT_EQ(read->size(), outputs.size());
    for (std::size_t k = 0; k < outputs.size(); ++k) {
      ASSERT_EQ((*read)[k].time_ns, outputs[k].time_ns);
      ASSERT_EQ((*read)[k].present, outputs[k].present);
      ASSERT_EQ((*read)[k].source, outputs[k].source);
      ASSERT_EQ((*read)[k].state, outputs[k].state);
      ASSERT_EQ((*read)[k].faults, outputs[k].faults);
      for (const auto& column : firmware::host::kTraceColumns) {
        if (column.role != firmware::host::TraceRole::kNumber) continue;
        ASSERT_EQ(std::bit_cast<std::uint32_t>((*read)[k].*column.number),
                  std::bit_cast<std::uint32_t>(outputs[k].*column.number));
      }
    }
  }
}

TEST(TraceWriter, LeavesNothingBehindUnlessFinished) {
  const ScratchFolder folder;
  for (const auto* const name : {"a.csv", "a.csv.gz"}) {
    auto writer = TraceWriter::create(folder.file(name)).value();
    for (int k = 0; k < 10'000; ++k) {
      LoopOutput output{};
      output.time_ns = k;
      ASSERT_TRUE(writer.write(output));
    }
    EXPECT_FALSE(std::filesystem::exists(folder.file(name)));
  }
  EXPECT_EQ(folder.file_count(), 0U);
  EXPECT_FALSE(TraceWriter::create(folder.file("none") / "a.csv"));
}

TEST(TraceReader, ReadsColumnsInAnyOrderAndASigmaThatIsNotGivenAsInfinite) {
  const ScratchFolder folder;
  const auto path = folder.write(
      "a.csv",
      "# cutforce trace 1\n# estimator: fused\n"
      "fault,cutting_force_sigma_n,state,t_s,extra,airgap_power_w,measured_power_w,airgap_torque_"
      "nm,"
      "load_torque_nm,cutting_torque_nm,cutting_torque_sigma_nm,cutting_force_n,source,"
      "override_pct\n"
      "gap|raw_pwm,,cut,1.5,what,1,2,3,4,,,7,fused,80\n");
  const auto rows = read_all(path);
  ASSERT_TRUE(rows) << rows.error().text();
  const LoopOutput& row = rows->at(0);
  EXPECT_EQ(row.time_ns, 1'500'000'000);
  EXPECT_EQ(row.state, LoopState::kCut);
  EXPECT_EQ(row.source, Source::kFused);
  EXPECT_TRUE(row.faults.contains(estimator::Fault::kRawPwm));
  EXPECT_EQ(row.cutting_force_n, 7.0F);
  EXPECT_EQ(row.cutting_force_sigma_n, std::numeric_limits<float>::infinity());
  EXPECT_EQ(row.cutting_torque_sigma_nm, 0.0F);
  EXPECT_EQ(row.present & LoopOutput::kCuttingTorque, 0U);
}

TEST(TraceReader, RefusesBadInputNamingItsPlace) {
  const ScratchFolder folder;
  const auto row = [](std::string_view text) { return std::string(kHeader) + std::string(text); };
  const struct {
    std::string text;
    std::string place;
  } cases[] = {
      {"", ":1:1"},
      {"# cutforce recording 1\n", ":1:1"},
      {"# cutforce trace 7\n", ":1:18"},
      {"# cutforce trace 1\nt_s,state\n", ":2:1"},
      {"# cutforce trace 1\nt_s,t_s\n", ":2:5"},
      {row("0,,,,,,,,,,,starting\n"), ":3:21"},
      {row("0,,,,,,,,,,,idle,\n"), ":3:13"},
      {row("0,,,,,,,,,guess,,air,\n"), ":3:11"},
      {row("0,,,,,,,,,,,air,gap|flood\n"), ":3:17"},
      {row("0,,x,,,,,,,,,air,\n"), ":3:4"},
      {row("0,nan,,,,,,,,,,air,\n"), ":3:3"},
      {row("1,,,,,,,,,,,air,\n1,,,,,,,,,,,air,\n"), ":4:1"},
      {row("x,,,,,,,,,,,air,\n"), ":3:1"},
  };
  for (const auto& [text, place] : cases) {
    SCOPED_TRACE(text);
    const auto path = folder.write("bad.csv", text);
    const auto rows = read_all(path);
    ASSERT_FALSE(rows);
    EXPECT_EQ(rows.error().where, path.string() + place) << rows.error().what;
  }
}

}  // namespace
}  // namespace cutforce
