#include "estimator/idle_calibration.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <random>

#include "support/allocation_count.hpp"
#include "support/same_bits.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::IdleCalibration;
using Channels = IdleCalibration::Channels;

constexpr IdleCalibration::Config config_at(float rate_hz, bool three_currents = true) {
  return {.sample_period_s = 1.0F / rate_hz,
          .shortest_s = 0.3F,
          .shortest_periods = 6.0F,
          .gain_limit_ratio = 0.1F,
          .three_currents = three_currents};
}
static_assert(config_at(5000.0F).check());

struct Defects {
  std::array<double, 6> offset{};
  std::array<double, 6> gain{1.0, 1.0, 1.0, 1.0, 1.0, 1.0};
  std::array<double, 6> noise{};
};

// Terminal signals of an idling motor, as defective channels show them.
Channels signals(double angle, const Defects& defects, std::mt19937& random, double sense = 1.0) {
  std::normal_distribution<double> normal;
  Channels x{};
  for (std::size_t k = 0; k < 6; ++k) {
    const double shift = 2.0 * std::numbers::pi / 3.0 * static_cast<double>(k % 3);
    const double peak = k < 3 ? 300.0 : 3.5;
    const double lag = k < 3 ? 0.0 : sense * 1.45;
    const double truth = peak * std::cos(angle - shift - lag);
    x[k] = static_cast<float>(truth / defects.gain[k] + defects.offset[k] +
                              defects.noise[k] * normal(random));
  }
  return x;
}

IdleCalibration::Result calibrate(const IdleCalibration::Config& config, double frequency_rad_s,
                                  const Defects& defects, std::uint32_t seed) {
  std::mt19937 random(seed);
  auto block = IdleCalibration::make(config).value();
  block.open(static_cast<float>(frequency_rad_s), 0.0F);
  EXPECT_TRUE(block.is_open());
  const double sense = frequency_rad_s < 0.0 ? -1.0 : 1.0;
  for (int k = 0; !block.is_full(); ++k) {
    const double t = k * static_cast<double>(config.sample_period_s);
    block.step(signals(0.7 + frequency_rad_s * t, defects, random, sense));
  }
  const auto result = block.take();
  EXPECT_FALSE(block.is_open());
  return result;
}

// Offsets of 1 % of rated peak and gains apart by 1 %; gains of mean 1, for a common one is hidden.
constexpr Defects kDefects{.offset = {3.2, -2.0, 1.1, 0.07, -0.05, 0.03},
                           .gain = {1.01, 0.99, 1.0, 0.992, 1.013, 0.995},
                           .noise = {}};

TEST(IdleCalibration, FindsOffsetsAndGainsAtAnyRateSpeedAndInBothDirections) {
  for (const float rate_hz : {1000.0F, 5000.0F, 20000.0F}) {
    for (const double hz : {10.0, 33.3, 50.0, 99.0, -50.0}) {
      const auto found = calibrate(config_at(rate_hz), 2.0 * std::numbers::pi * hz, kDefects, 1);
      for (std::size_t k = 0; k < 6; ++k) {
        const double peak = k < 3 ? 300.0 : 3.5;
        EXPECT_NEAR(found.offset[k], kDefects.offset[k], 1e-4 * peak) << rate_hz << ' ' << hz;
        EXPECT_NEAR(found.gain[k], kDefects.gain[k], 1e-4) << rate_hz << ' ' << hz << ' ' << k;
      }
    }
  }
}

TEST(IdleCalibration, FindsTheRatioOfTwoCurrentsInBothDirections) {
  Defects defects = kDefects;
  defects.gain = {1.0, 1.0, 1.0, 1.012, 0.988, 1.0};
  for (const double hz : {50.0, -50.0}) {
    const auto found =
        calibrate(config_at(5000.0F, false), 2.0 * std::numbers::pi * hz, defects, 1);
    EXPECT_NEAR(found.gain[3], 1.012F, 2e-4F) << hz;
    EXPECT_NEAR(found.gain[4], 0.988F, 2e-4F) << hz;
    EXPECT_EQ(found.gain[5], 1.0F);
  }
}

// Of N samples the Hann window leaves sigma sqrt(1.5/N) in an offset.
TEST(IdleCalibration, ScattersAsTheNoisePredicts) {
  Defects defects = kDefects;
  defects.noise = {1.6, 1.6, 1.6, 0.035, 0.035, 0.035};
  constexpr int kRuns = 200;
  double offset_squares = 0.0;
  double gain_squares = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    const auto found =
        calibrate(config_at(1000.0F), 314.159, defects, static_cast<std::uint32_t>(100 + run));
    const double offset = static_cast<double>(found.offset[3]) - defects.offset[3];
    const double gain = static_cast<double>(found.gain[3]) - defects.gain[3];
    offset_squares += offset * offset;
    gain_squares += gain * gain;
  }
  const double predicted = 0.035 * std::sqrt(1.5 / 300.0);
  const double measured = std::sqrt(offset_squares / kRuns);
  EXPECT_NEAR(measured, predicted, 0.2 * predicted);
  // A phasor scatters by sqrt(2) sigma sqrt(1.5/N) in each part, and with it gains: EQUATIONS
  // (E82).
  const double gain_predicted = std::sqrt(2.0) * predicted / 3.5 * std::sqrt(4.0 / 3.0);
  EXPECT_NEAR(std::sqrt(gain_squares / kRuns), gain_predicted, 0.2 * gain_predicted);
}

TEST(IdleCalibration, LeavesGainsAloneThatItCannotBelieve) {
  Defects far = kDefects;
  far.gain = {1.3, 0.85, 0.85, 1.0, 1.0, 1.0};
  const auto found = calibrate(config_at(5000.0F), 314.159, far, 1);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(found.gain[k], 1.0F);
  EXPECT_NEAR(found.offset[0], 3.2F, 0.05F);  // offsets do not depend on it

  Defects dead = kDefects;
  dead.gain[4] = 1e9;  // a channel that shows nothing but its offset
  const auto without = calibrate(config_at(5000.0F), 314.159, dead, 1);
  for (std::size_t k = 3; k < 6; ++k) EXPECT_EQ(without.gain[k], 1.0F);

  Defects swapped{};
  const auto two = calibrate(config_at(5000.0F, false), 314.159, swapped, 1);
  EXPECT_NEAR(two.gain[3], 1.0F, 1e-4F);
}

TEST(IdleCalibration, LengthensTheWindowToWholePeriodsAndToTheWish) {
  auto block = IdleCalibration::make(config_at(5000.0F)).value();
  block.open(314.159F, 0.0F);
  EXPECT_EQ(block.state().length, 1500U);
  block.open(-314.159F, 1.0F);
  EXPECT_EQ(block.state().length, 5000U);
  block.open(31.4159F, 0.0F);  // 6 periods of 0.2 s
  EXPECT_EQ(block.state().length, 6000U);
}

TEST(IdleCalibration, OpensNoWindowNearStandstill) {
  auto block = IdleCalibration::make(config_at(5000.0F)).value();
  for (const float w : {0.0F, 0.5F, -0.9F, NAN}) {
    block.open(w, 0.0F);
    EXPECT_FALSE(block.is_open()) << w;
    block.step({});
    EXPECT_FALSE(block.is_full()) << w;
  }
}

TEST(IdleCalibration, RefusesWhatItCannotWorkWith) {
  using Error = IdleCalibration::ConfigError;
  const auto refused = [](auto change) {
    auto config = config_at(5000.0F);
    change(config);
    const auto made = IdleCalibration::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.sample_period_s = NAN; }), Error::kPeriod);
  EXPECT_EQ(refused([](auto& c) { c.shortest_s = 0.0F; }), Error::kLength);
  EXPECT_EQ(refused([](auto& c) { c.shortest_periods = 1.5F; }), Error::kLength);
  EXPECT_EQ(refused([](auto& c) { c.gain_limit_ratio = 0.6F; }), Error::kLimit);
  EXPECT_EQ(refused([](auto&) {}), std::nullopt);
}

TEST(IdleCalibration, NeverGivesAGainOutsideItsLimitUnderRandomSignals) {
  std::mt19937 random(21);
  std::uniform_real_distribution<float> draw(-1.0F, 1.0F);
  for (int run = 0; run < 300; ++run) {
    auto config = config_at(1000.0F, run % 2 == 0);
    config.shortest_s = 0.05F;
    config.shortest_periods = 2.0F;
    auto block = IdleCalibration::make(config).value();
    block.open(1000.0F * draw(random), 0.0F);
    if (!block.is_open()) continue;
    while (!block.is_full()) {
      Channels x{};
      for (float& value : x) value = 500.0F * draw(random);
      block.step(x);
    }
    const auto found = block.take();
    for (std::size_t k = 0; k < 6; ++k) {
      ASSERT_TRUE(found.gain[k] > 0.8999F && found.gain[k] < 1.1001F) << run << ' ' << k;
      ASSERT_LT(std::abs(found.offset[k]), 500.0F);
    }
  }
}

TEST(IdleCalibration, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  std::mt19937 random(22);
  auto original = IdleCalibration::make(config_at(1000.0F)).value();
  auto resumed = original;
  const auto allocations = allocation_count();
  original.open(314.159F, 0.0F);
  for (int k = 0; !original.is_full(); ++k) {
    resumed.restore(original.state());
    const auto x = signals(0.314159 * k, kDefects, random);
    original.step(x);
    resumed.step(x);
    ASSERT_TRUE(same_bits(original.state(), resumed.state())) << k;
  }
  ASSERT_TRUE(same_bits(original.take(), resumed.take()));
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
