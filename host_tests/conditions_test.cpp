// Worse sensors and worse machine files, made from a good recording.
#include "firmware/host/evaluation/conditions.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>
#include <set>
#include <string>

namespace cutforce::firmware::host {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

Machine motor() {
  Machine machine{};
  machine.voltage_kind = VoltageKind::kLineToNeutral;
  machine.current_w_present = true;
  machine.speed_present = true;
  machine.stator_resistance_ohm = 3.7F;
  machine.inertia_kg_m2 = 0.03F;
  machine.rated_power_w = 2200.0F;
  machine.rated_torque_nm = 14.6F;
  machine.rated_current_a_rms = 5.0F;
  return machine;
}

std::vector<hal::Sample> turning(std::size_t count, double rate_hz, float speed_rad_s = 157.08F) {
  std::vector<hal::Sample> samples(count);
  for (std::size_t k = 0; k < count; ++k) {
    auto& s = samples[k];
    const double t = static_cast<double>(k) / rate_hz;
    const auto angle =
        static_cast<float>(std::fmod(2.0 * std::numbers::pi * 50.0 * t, 2.0 * std::numbers::pi));
    s.time_ns = static_cast<std::int64_t>(std::llround(1e9 * t));
    for (std::size_t phase = 0; phase < 3; ++phase) {
      const float shift = 2.0F * kPi / 3.0F * static_cast<float>(phase);
      s.voltage_v[phase] = 310.0F * std::cos(angle - shift);
      s.current_a[phase] = 6.0F * std::cos(angle - shift - 0.6F);
    }
    s.speed_rad_s = speed_rad_s;
    s.present = 0x7FU;  // three voltages, three currents, speed
  }
  return samples;
}

std::vector<hal::Sample> spoiled(std::string_view name, std::vector<hal::Sample> samples,
                                 std::uint64_t seed = 1) {
  const Condition* condition = find_condition(name);
  EXPECT_NE(condition, nullptr) << name;
  SampleConditioner conditioner(*condition, motor(), seed);
  conditioner.apply(samples);
  return samples;
}

struct Moments {
  double mean;
  double deviation;
};

template <class Read>
Moments moments(const std::vector<hal::Sample>& a, const std::vector<hal::Sample>& b, Read read) {
  double sum = 0.0;
  double square = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    const double d = static_cast<double>(read(a[k]) - read(b[k]));
    sum += d;
    square += d * d;
  }
  const auto n = static_cast<double>(a.size());
  return {.mean = sum / n, .deviation = std::sqrt(square / n - sum * sum / n / n)};
}

TEST(Conditions, HaveNamesThatDifferAndAreFoundAgain) {
  std::set<std::string_view> names;
  for (const auto& condition : all_conditions()) {
    EXPECT_TRUE(names.insert(condition.name).second) << condition.name;
    EXPECT_EQ(find_condition(condition.name), &condition);
    EXPECT_FALSE(condition.description.empty());
  }
  EXPECT_EQ(find_condition("no such condition"), nullptr);
}

TEST(Conditions, LeaveARecordingAsItIsBitForBit) {
  const auto before = turning(500, 5000.0);
  const auto after = spoiled("as_recorded", before);
  EXPECT_EQ(std::memcmp(before.data(), after.data(), before.size() * sizeof(hal::Sample)), 0);
}

TEST(Conditions, AddSpeedNoiseOfTheGivenSizeAndNothingElse) {
  const auto before = turning(50000, 5000.0);
  const auto after = spoiled("speed_noise_0.05", before);
  const auto noise = moments(after, before, [](const hal::Sample& s) { return s.speed_rad_s; });
  EXPECT_NEAR(noise.mean, 0.0, 0.001);
  EXPECT_NEAR(noise.deviation, 0.05, 0.001);
  for (std::size_t k = 0; k < before.size(); ++k)
    ASSERT_EQ(after[k].voltage_v, before[k].voltage_v);
}

TEST(Conditions, AreTheSameForTheSameSeedHoweverTheStreamIsCut) {
  const auto before = turning(1000, 5000.0);
  const auto whole = spoiled("offsets_noise", before, 7);
  auto pieces = before;
  SampleConditioner conditioner(*find_condition("offsets_noise"), motor(), 7);
  for (std::size_t k = 0; k < pieces.size(); k += 50)
    conditioner.apply(std::span(pieces).subspan(k, 50));
  EXPECT_EQ(std::memcmp(whole.data(), pieces.data(), whole.size() * sizeof(hal::Sample)), 0);
  const auto other = spoiled("offsets_noise", before, 8);
  EXPECT_NE(std::memcmp(whole.data(), other.data(), whole.size() * sizeof(hal::Sample)), 0);
}

TEST(Conditions, OffsetAndNoiseArePercentOfTheRatedPeak) {
  const auto before = turning(50000, 5000.0);
  const auto after = spoiled("offsets_noise", before);
  const float current_peak_a = 5.0F * std::numbers::sqrt2_v<float>;
  const auto v = moments(after, before, [](const hal::Sample& s) { return s.voltage_v[2]; });
  const auto i = moments(after, before, [](const hal::Sample& s) { return s.current_a[1]; });
  EXPECT_NEAR(v.mean, -3.24, 0.05);  // 1 % of 2200 W / 0.64 / (1.5 * 7.07 A) = 324 V
  EXPECT_NEAR(v.deviation, 1.62, 0.05);
  EXPECT_NEAR(i.mean, -0.007 * static_cast<double>(current_peak_a), 0.002);
  // Noise, and the gain error of 1 % of a sinusoid of 6 A.
  EXPECT_NEAR(i.deviation, std::hypot(0.005 * 7.07, 0.06 / std::numbers::sqrt2), 0.002);
}

TEST(Conditions, TwelveBitsPutEveryChannelOnTheConvertersGrid) {
  const auto after = spoiled("offsets_noise", turning(500, 5000.0));
  const float step = 2.0F * 4.0F * 5.0F * std::numbers::sqrt2_v<float> / 4096.0F;
  for (const auto& sample : after) {
    const float counts = sample.current_a[0] / step;
    ASSERT_NEAR(counts, std::round(counts), 1e-2F);
  }
}

// The counts of one second must add up to the turns made, however coarse each difference is.
TEST(Conditions, EncoderCountsKeepTheAngle) {
  constexpr float kSpeed = 157.08F;
  for (const auto* name : {"counts_4096", "counts_1024", "sample_counts_4096"}) {
    SCOPED_TRACE(name);
    const auto after = spoiled(name, turning(50001, 5000.0, kSpeed));
    const double per_turn = std::string_view(name) == "counts_1024" ? 1024.0 : 4096.0;
    const double interval_s = std::string_view(name).starts_with("sample") ? 2e-4 : 1e-3;
    const double step = 2.0 * std::numbers::pi / per_turn / interval_s;
    double sum = 0.0;
    for (std::size_t k = 6; k < after.size(); ++k) {
      const double speed = static_cast<double>(after[k].speed_rad_s);
      const double counts = speed / step;
      ASSERT_NEAR(counts, std::round(counts), 1e-3) << k;
      ASSERT_LE(std::abs(speed - static_cast<double>(kSpeed)), step * 1.001) << k;
      sum += speed;
    }
    EXPECT_NEAR(sum / static_cast<double>(after.size() - 6), static_cast<double>(kSpeed), 0.01);
  }
}

TEST(Conditions, CountsOfSlowSamplingAreTakenOverTheSampleInterval) {
  const auto after = spoiled("counts_4096", turning(200, 250.0, 100.0F));
  const double step = 2.0 * std::numbers::pi / 4096.0 * 250.0;
  for (std::size_t k = 1; k < after.size(); ++k)
    ASSERT_LE(std::abs(static_cast<double>(after[k].speed_rad_s) - 100.0), step);
}

TEST(Conditions, TakeTheSpeedAwayFromSamplesAndMachine) {
  for (const auto& sample : spoiled("no_speed", turning(10, 1000.0))) {
    EXPECT_FALSE(sample.has(hal::Signal::kSpeed));
    EXPECT_EQ(sample.speed_rad_s, 0.0F);
  }
  EXPECT_FALSE(worsened(*find_condition("no_speed"), motor()).speed_present);
}

TEST(Conditions, LineToLineVoltagesAndTwoCurrentsCarryTheSamePower) {
  const auto before = turning(100, 1000.0);
  const auto after = spoiled("two_currents", before);
  const Machine machine = worsened(*find_condition("two_currents"), motor());
  EXPECT_EQ(machine.voltage_kind, VoltageKind::kLineToLine);
  EXPECT_FALSE(machine.current_w_present);
  for (std::size_t k = 0; k < before.size(); ++k) {
    const auto& b = before[k];
    const auto& a = after[k];
    EXPECT_FALSE(a.has(hal::Signal::kCurrentW));
    const float dot = b.voltage_v[0] * b.current_a[0] + b.voltage_v[1] * b.current_a[1] +
                      b.voltage_v[2] * b.current_a[2];
    const float wattmeters = -a.voltage_v[2] * a.current_a[0] + a.voltage_v[1] * a.current_a[1];
    EXPECT_NEAR(wattmeters, dot, 0.01F);
  }
}

TEST(Conditions, ChangeTheMachineFileOnlyWhereTheySaySo) {
  EXPECT_FLOAT_EQ(worsened(*find_condition("resistance_-40"), motor()).stator_resistance_ohm,
                  2.22F);
  EXPECT_FLOAT_EQ(worsened(*find_condition("inertia_+20"), motor()).inertia_kg_m2, 0.036F);
  EXPECT_TRUE(worsened(*find_condition("resistance_+20_iron"), motor()).iron_loss_declared);
  EXPECT_FLOAT_EQ(worsened(*find_condition("voltage_+2"), motor()).stator_resistance_ohm, 3.7F);
  const auto before = turning(10, 1000.0);
  const auto after = spoiled("voltage_+2", before);
  EXPECT_FLOAT_EQ(after[3].voltage_v[1], 1.02F * before[3].voltage_v[1]);
}

TEST(Conditions, AreLeftOutWhereTheRecordingCannotBearThem) {
  Machine machine = motor();
  machine.speed_present = false;
  EXPECT_FALSE(applies(*find_condition("speed_noise_0.2"), machine));
  EXPECT_FALSE(applies(*find_condition("no_speed"), machine));
  EXPECT_TRUE(applies(*find_condition("offsets"), machine));
  machine = motor();
  machine.stator_resistance_ohm = 0.0F;
  EXPECT_FALSE(applies(*find_condition("resistance_+20"), machine));
  machine = motor();
  machine.voltage_kind = VoltageKind::kLineToLine;
  EXPECT_FALSE(applies(*find_condition("two_currents"), machine));
}

struct FixedPort {
  std::expected<std::size_t, hal::PortError> read(std::span<hal::Sample> block) {
    if (done) return std::size_t{0};
    done = true;
    const auto samples = turning(3, 1000.0);
    std::copy(samples.begin(), samples.end(), block.begin());
    return samples.size();
  }
  std::expected<void, hal::PortError> write(const hal::Command& command) {
    last = command.override_pct;
    return {};
  }
  bool done = false;
  int last = 0;
};

TEST(ConditionedPort, SpoilsWhatIsReadAndPassesOnWhatIsWritten) {
  FixedPort inner;
  SampleConditioner conditioner(*find_condition("no_speed"), motor(), 1);
  ConditionedPort port(inner, conditioner);
  static_assert(hal::Port<decltype(port)>);
  std::array<hal::Sample, 8> block{};
  ASSERT_EQ(port.read(block).value(), 3U);
  EXPECT_FALSE(block[2].has(hal::Signal::kSpeed));
  EXPECT_EQ(port.read(block).value(), 0U);
  ASSERT_TRUE(
      port.write({.time_ns = 0, .override_pct = 77, .override_code = 0, .controlling = true}));
  EXPECT_EQ(inner.last, 77);
}

}  // namespace
}  // namespace cutforce::firmware::host
