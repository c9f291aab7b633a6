#include "hal/linux/iio_source.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "support/allocation_count.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::hal::os {
namespace {

namespace fs = std::filesystem;
using host_tests::bytes_of;
constexpr std::int64_t kPeriodNs = 100'000;

// A folder that looks like a converter with four channels of 16 bits and a timestamp; its node is
// a plain file with what the test writes. Plain files take every value, as no driver does.
class FakeDevice {
 public:
  FakeDevice() {
    fs::create_directories(device() / "scan_elements");
    fs::create_directories(device() / "buffer");
    fs::create_directories(device() / "trigger");
    fs::create_directories(folder_.path() / "sys/bus/iio/devices/trigger0");
    write("name", "ads7950\n");
    for (int i = 0; i < 4; ++i) {
      channel("in_voltage" + std::to_string(i), std::to_string(i), "be:s16/16>>0");
    }
    channel("in_timestamp", "4", "le:s64/64>>0");
    write("in_voltage_scale", "0.5\n");
    write("in_voltage3_scale", "2.0\n");
    write("in_voltage3_offset", "-100\n");
    write("scan_elements/in_voltage2_en", "1\n");  // left on by someone
    for (const auto* file : {"buffer/enable", "buffer/length", "buffer/watermark"})
      write(file, "0\n");
    write("trigger/current_trigger", "\n");
    write("current_timestamp_clock", "realtime\n");
    write("../trigger0/name", "tick\n");
    write("../trigger0/sampling_frequency", "100\n");
    fs::create_directories(folder_.path() / "dev");
    const std::ofstream empty(node());
  }

  void write(const std::string& file, std::string_view text) const {
    std::ofstream(device() / file) << text;
  }
  void channel(const std::string& name, const std::string& index, const std::string& type) const {
    write("scan_elements/" + name + "_en", "0\n");
    write("scan_elements/" + name + "_index", index + "\n");
    write("scan_elements/" + name + "_type", type + "\n");
  }
  [[nodiscard]] std::string read(const std::string& file) const {
    return bytes_of(device() / file);
  }
  [[nodiscard]] fs::path device() const {
    return folder_.path() / "sys/bus/iio/devices/iio:device0";
  }
  [[nodiscard]] fs::path node() const { return folder_.path() / "dev/iio:device0"; }

  [[nodiscard]] IioConfig config() const {
    return {.device = "ads7950",
            .signals = {{Signal::kVoltageU, "in_voltage1", 10.0},
                        {Signal::kCurrentU, "in_voltage3", 0.1}},
            .trigger = "tick",
            .sample_rate_hz = 10'000.0,
            .set_sample_rate = true,
            .buffer_samples = 64,
            .watermark = 8,
            .sys_root = folder_.path() / "sys",
            .dev_root = folder_.path() / "dev"};
  }

 private:
  host_tests::ScratchFolder folder_;
};

// One scan of the two channels and the timestamp: 2 + 2 bytes, 4 of padding, 8.
std::string scan(std::int16_t first, std::int16_t second, std::int64_t time_ns) {
  std::string bytes(16, '\x55');
  const auto put = [&](std::size_t at, std::int16_t value) {
    bytes[at] = static_cast<char>(value >> 8);
    bytes[at + 1] = static_cast<char>(value & 0xFF);
  };
  put(0, first);
  put(2, second);
  for (unsigned i = 0; i < 8; ++i) bytes[8 + i] = static_cast<char>(time_ns >> 8 * i & 0xFF);
  return bytes;
}

void append(const FakeDevice& device, const std::string& bytes) {
  std::ofstream(device.node(), std::ios::binary | std::ios::app) << bytes;
}

std::string refusal(const IioConfig& config) {
  const auto source = IioSource::open(config);
  EXPECT_FALSE(source);
  return source ? "" : source.error().text();
}

TEST(IioSource, SetsTheDeviceUpAsTheMachineFileSays) {
  const FakeDevice device;
  {
    const auto source = IioSource::open(device.config());
    ASSERT_TRUE(source) << source.error().text();
    EXPECT_EQ(device.read("buffer/enable"), "1");
    EXPECT_TRUE(source->has_time());
  }
  EXPECT_EQ(device.read("buffer/enable"), "0") << "left running";
  EXPECT_EQ(device.read("scan_elements/in_voltage0_en"), "0");
  EXPECT_EQ(device.read("scan_elements/in_voltage1_en"), "1");
  EXPECT_EQ(device.read("scan_elements/in_voltage2_en"), "0") << "another's channel shifts ours";
  EXPECT_EQ(device.read("scan_elements/in_timestamp_en"), "1");
  EXPECT_EQ(device.read("trigger/current_trigger"), "tick");
  EXPECT_EQ(device.read("../trigger0/sampling_frequency"), "10000");
  EXPECT_EQ(device.read("current_timestamp_clock"), "monotonic");
  EXPECT_EQ(device.read("buffer/length"), "64");
  EXPECT_EQ(device.read("buffer/watermark"), "8");
}

TEST(IioSource, GivesSiUnitsByTheScaleOfTheTypeOrOfTheChannel) {
  const FakeDevice device;
  auto source = IioSource::open(device.config());
  ASSERT_TRUE(source);
  append(device, scan(-200, 300, 1'000'000));
  std::array<Sample, 4> block{};
  const auto reading = source->read(block);
  ASSERT_TRUE(reading);
  ASSERT_EQ(reading->count, 1U);
  EXPECT_EQ(block[0].voltage_v[0], -200 * 0.5F * 10);
  EXPECT_FLOAT_EQ(block[0].current_a[0], (300 - 100) * 2.0F * 0.1F);
  EXPECT_EQ(block[0].time_ns, 1'000'000);
  EXPECT_EQ(block[0].present, bit(Signal::kVoltageU) | bit(Signal::kCurrentU));
}

TEST(IioSource, GivesNothingWhereNothingHasComeAndNoMoreThanFits) {
  const FakeDevice device;
  auto source = IioSource::open(device.config());
  ASSERT_TRUE(source);
  std::array<Sample, 3> block{};
  EXPECT_EQ(source->read(block).value().count, 0U);
  for (int i = 0; i < 7; ++i) append(device, scan(static_cast<std::int16_t>(i), 0, i * kPeriodNs));
  EXPECT_EQ(source->read(block).value().count, 3U);
  EXPECT_EQ(source->read(block).value().count, 3U);
  EXPECT_EQ(source->read(block).value().count, 1U);
  EXPECT_EQ(block[0].voltage_v[0], 6 * 0.5F * 10);
}

TEST(IioSource, PutsTogetherAScanThatComesInParts) {
  const FakeDevice device;
  auto source = IioSource::open(device.config());
  ASSERT_TRUE(source);
  std::string bytes;
  for (int i = 0; i < 50; ++i) bytes += scan(static_cast<std::int16_t>(i), 0, i * kPeriodNs);
  std::array<Sample, 8> block{};
  std::size_t got = 0;
  for (std::size_t at = 0; at < bytes.size(); at += 7) {
    append(device, bytes.substr(at, 7));
    const auto reading = source->read(block);
    ASSERT_TRUE(reading);
    EXPECT_EQ(reading->lost, 0U);
    for (std::size_t i = 0; i < reading->count; ++i, ++got) {
      ASSERT_EQ(block[i].voltage_v[0], static_cast<float>(got) * 5.0F);
    }
  }
  EXPECT_EQ(got, 50U);
}

TEST(IioSource, CountsWhatAGapInTimeLeavesOut) {
  const FakeDevice device;
  auto source = IioSource::open(device.config());
  ASSERT_TRUE(source);
  for (const int period : {0, 1, 2, 6, 7, 20}) append(device, scan(1, 1, period * kPeriodNs));
  std::array<Sample, 8> block{};
  const auto reading = source->read(block);
  ASSERT_TRUE(reading);
  EXPECT_EQ(reading->count, 6U);
  EXPECT_EQ(reading->lost, 3U + 12U);
}

TEST(IioSource, RefusesTimeThatGoesBackAndGoesOnAfterIt) {
  const FakeDevice device;
  auto source = IioSource::open(device.config());
  ASSERT_TRUE(source);
  std::array<Sample, 8> block{};
  append(device,
         scan(1, 1, 5 * kPeriodNs) + scan(1, 1, 4 * kPeriodNs) + scan(1, 1, 0).substr(0, 9));
  EXPECT_EQ(source->read(block).error(), PortError::kMalformed);
  append(device, scan(1, 1, 0).substr(9) + scan(9, 1, 6 * kPeriodNs));
  EXPECT_EQ(source->read(block).error(), PortError::kMalformed);
  append(device, scan(9, 1, 7 * kPeriodNs));
  EXPECT_EQ(source->read(block).value().count, 1U);
  EXPECT_EQ(block[0].voltage_v[0], 45.0F);
}

TEST(IioSource, CountsPeriodsAndSaysSoWhereTheDeviceHasNoTime) {
  const FakeDevice device;
  for (const auto* end : {"_en", "_type", "_index"}) {
    fs::remove(device.device() / ("scan_elements/in_timestamp" + std::string(end)));
  }
  auto source = IioSource::open(device.config());
  ASSERT_TRUE(source);
  EXPECT_FALSE(source->has_time());
  append(device, std::string("\0\1\0\2\0\3\0\4", 8));  // two scans of four bytes
  std::array<Sample, 8> block{};
  EXPECT_EQ(source->read(block).value().count, 2U);
  EXPECT_EQ(block[1].time_ns - block[0].time_ns, kPeriodNs);
  EXPECT_EQ(block[1].voltage_v[0], 15.0F);
}

TEST(IioSource, AllocatesNothingAfterOpening) {
  const FakeDevice device;
  auto source = IioSource::open(device.config());
  ASSERT_TRUE(source);
  std::string bytes;
  for (int i = 0; i < 1000; ++i) bytes += scan(1, 1, i * kPeriodNs);
  append(device, bytes);
  std::array<Sample, 16> block{};
  const auto before = host_tests::allocation_count();
  std::size_t got = 0;
  for (auto reading = source->read(block); reading && reading->count > 0;
       reading = source->read(block)) {
    got += reading->count;
  }
  EXPECT_EQ(host_tests::allocation_count() - before, 0U);
  EXPECT_EQ(got, 1000U);
}

TEST(IioSource, RefusesAnotherDeviceThanTheMachineFileNamesAndListsThem) {
  const FakeDevice device;
  auto config = device.config();
  config.device = "ad7606";
  EXPECT_NE(refusal(config).find("name one of: iio:device0 [ads7950]"), std::string::npos);
  config.sys_root = "/nowhere";
  EXPECT_NE(refusal(config).find("load the converter's driver"), std::string::npos);
}

TEST(IioSource, RefusesAnotherChannelThanItHasAndListsThem) {
  const FakeDevice device;
  auto config = device.config();
  config.signals[0].channel = "in_current0";
  EXPECT_NE(refusal(config).find("no channel in_current0\n  remedy: name one of: in_timestamp, "
                                 "in_voltage0, in_voltage1"),
            std::string::npos);
}

TEST(IioSource, RefusesAnotherTypeThanItCanRead) {
  for (const auto* type : {"le:s16/16X2>>0", "le:s64/64>>0", "le:f32/32>>0", "", "garbage"}) {
    const FakeDevice device;
    device.channel("in_voltage1", "1", type);
    EXPECT_NE(refusal(device.config()).find("channel in_voltage1 has the type"), std::string::npos)
        << type;
    EXPECT_EQ(device.read("buffer/enable"), "0\n") << "half set up";
  }
}

TEST(IioSource, RefusesAMachineFileThatContradictsItself) {
  const FakeDevice device;
  auto twice = device.config();
  twice.signals[1].channel = twice.signals[0].channel;
  EXPECT_NE(refusal(twice).find("named twice"), std::string::npos);
  auto same = device.config();
  same.signals[1].signal = same.signals[0].signal;
  EXPECT_NE(refusal(same).find("named twice"), std::string::npos);
  auto zero = device.config();
  zero.signals[0].gain = 0.0;
  EXPECT_NE(refusal(zero).find("gain of 0"), std::string::npos);
  auto rate = device.config();
  rate.sample_rate_hz = 0.0;
  EXPECT_NE(refusal(rate).find("sample rate"), std::string::npos);
  auto none = device.config();
  none.signals.clear();
  EXPECT_NE(refusal(none).find("no signal"), std::string::npos);
}

TEST(IioSource, SaysWhichFileTheKernelWouldNotTake) {
  const FakeDevice device;
  fs::remove(device.device() / "buffer/watermark");
  fs::create_directory(device.device() / "buffer/watermark");  // cannot be written
  const auto text = refusal(device.config());
  EXPECT_NE(text.find("buffer/watermark: \"8\" cannot be written"), std::string::npos) << text;
  EXPECT_EQ(device.read("buffer/enable"), "0") << "half set up";
}

}  // namespace
}  // namespace cutforce::hal::os
