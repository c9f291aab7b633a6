#include "control/latency_bank.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <tuple>

#include "support/allocation_count.hpp"
#include "support/predictive_lathe.hpp"
#include "support/same_bits.hpp"

namespace cutforce::control {
namespace {

constexpr LatencyBank::Config kLathe{.period_s = 0.05F,
                                     .latency_s = 0.035F,
                                     .most_latency_s = 0.4F,
                                     .feed_lag_s = 0.03F,
                                     .cut_lag_s = 0.1F,
                                     .sensor_lag_s = 0.031F};
static_assert(kLathe.check());
constexpr float kGrid_s = 0.4F / 9.0F;

// A part of many steps, cut by a law that believes in 35 ms.
float found_s(double latency_s, std::uint32_t seed, float& least_margin) {
  std::vector<hal::host::ProfilePoint> points;
  for (int k = 0; k < 30; ++k) {
    const double depth_m = k % 2 == 0 ? 1e-3 : 2e-3;
    points.push_back({k * 4e-3, depth_m});
    points.push_back({(k + 1) * 4e-3, depth_m});
  }
  auto part = host_tests::lathe_part(hal::host::Profile(points), 0.12);
  part.starts_in_cut = true;
  part.feed.scan_s = 0.0;
  part.feed.latency_s = latency_s;
  host_tests::add_noise(part, seed);
  auto law = host_tests::kPredictiveLathe;
  law.finds_latency = true;
  auto path = host_tests::PredictivePath::make(host_tests::predictive_path(law)).value();
  const auto ticks = host_tests::cut(path, part, 90.0);
  least_margin = ticks.back().output.law.stability_margin_ratio;
  return path.state().law.bank.latency_s;
}

TEST(LatencyBank, FindsTheDeadTimeInTheClosedLoop) {
  for (const double latency_s : {0.035, 0.1, 0.2, 0.4}) {
    for (std::uint32_t seed = 1; seed <= 4; ++seed) {
      float margin = 0.0F;
      const float seen_s = found_s(latency_s, seed, margin);
      RecordProperty("found_at_" + std::to_string(latency_s) + "_" + std::to_string(seed),
                     std::to_string(seen_s));
      EXPECT_NEAR(seen_s, latency_s, kGrid_s + 1e-4F) << latency_s << ' ' << seed;
    }
  }
}

std::array<float, 24> steady() {
  std::array<float, 24> sent;
  sent.fill(1.0F);
  return sent;
}

TEST(LatencyBank, DoesNotMoveWhileTheOverrideStandsStill) {
  auto bank = LatencyBank::make(kLathe).value();
  std::mt19937 random(1);
  std::normal_distribution<float> noise(500.0F, 20.0F);
  const auto sent = steady();
  for (int i = 0; i < 100'000; ++i) {
    const auto out = bank.step({.sent = sent, .reading_n = noise(random), .usable = true});
    ASSERT_EQ(out.latency_s, kLathe.latency_s);
    ASSERT_EQ(out.misfit_ratio, 1.0F);
  }
  EXPECT_EQ(bank.state().evidence, 0.0F);
}

// Steps of the override through a plant with this dead time in whole ticks; only the ratio counts.
float misfit_with(std::size_t ticks, float believed_s, float gain_n, bool usable,
                  float& latency_s) {
  auto config = kLathe;
  config.latency_s = believed_s;
  auto bank = LatencyBank::make(config).value();
  const auto lag = LagStep::of(0.05F, 0.03F, 0.1F, 0.031F);
  auto sent = steady();
  FeedState feed{.v = 1.0F};
  float force = 1.0F, sensed = 1.0F;
  LatencyBank::Output out{};
  for (int i = 0; i < 60; ++i) {
    for (std::size_t k = sent.size() - 1; k > 0; --k) sent[k] = sent[k - 1];
    sent[0] = i / 10 % 2 == 0 ? 0.5F : 1.5F;
    const float mean = feed.advance(lag, sent[ticks]);
    sensed = lag.sensed * sensed + lag.sensed_force * force + lag.sensed_input * mean;
    force = lag.cut * force + (1.0F - lag.cut) * mean;
    out = bank.step({.sent = sent, .reading_n = gain_n * sensed, .usable = usable});
    if (i == 12) latency_s = out.misfit_ratio;
  }
  const float early = latency_s;
  latency_s = out.latency_s;
  return early;
}

TEST(LatencyBank, PublishesHowFarTheTimingIsFromWhatIsSeenAtAnyGain) {
  for (const float gain_n : {20.0F, 400.0F, 5000.0F}) {
    float latency_s = 0.0F;
    EXPECT_LT(misfit_with(4, 0.035F, gain_n, true, latency_s), 0.45F);
    EXPECT_NEAR(latency_s, 0.2F, kGrid_s);
    EXPECT_GT(misfit_with(4, 0.2F, gain_n, true, latency_s), 0.2F);
    EXPECT_NEAR(latency_s, 0.2F, kGrid_s);
  }
  float latency_s = 0.0F;
  EXPECT_EQ(misfit_with(4, 0.035F, 400.0F, false, latency_s), 1.0F);  // not to be used
  EXPECT_EQ(latency_s, 0.035F);
}

TEST(LatencyBank, RefusesEveryConfigThatBreaksARule) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  using Config = LatencyBank::Config;
  using Error = LatencyBank::ConfigError;
  const struct {
    void (*spoil)(Config&);
    Error error;
  } cases[] = {
      {[](Config& c) { c.period_s = 0.0F; }, Error::kPeriod},
      {[](Config& c) { c.period_s = kNan; }, Error::kPeriod},
      {[](Config& c) { c.latency_s = -1.0F; }, Error::kLatency},
      {[](Config& c) { c.latency_s = kNan; }, Error::kLatency},
      {[](Config& c) { c.most_latency_s = 0.0F; }, Error::kLatency},
      {[](Config& c) { c.most_latency_s = kNan; }, Error::kLatency},
      {[](Config& c) { c.feed_lag_s = kNan; }, Error::kLags},
      {[](Config& c) { c.cut_lag_s = 0.0F; }, Error::kLags},
      {[](Config& c) { c.cut_lag_s = kNan; }, Error::kLags},
      {[](Config& c) { c.sensor_lag_s = kNan; }, Error::kLags},
      {[](Config& c) { c.sensor_lag_s = c.cut_lag_s; }, Error::kLags},
  };
  for (const auto& c : cases) {
    Config config = kLathe;
    c.spoil(config);
    ASSERT_FALSE(config.check());
    EXPECT_EQ(config.check().error(), c.error);
    EXPECT_FALSE(LatencyBank::make(config));
  }
}

TEST(LatencyBank, StaysWithinItsGridAndContinuesBitExactlyWithoutAllocating) {
  std::mt19937 random(31);
  auto bank = LatencyBank::make(kLathe).value();
  auto resumed = bank;
  auto sent = steady();
  const auto allocations = host_tests::allocation_count();
  for (int i = 0; i < 300'000; ++i) {
    for (std::size_t k = sent.size() - 1; k > 0; --k) sent[k] = sent[k - 1];
    if (random() % 4 == 0) sent[0] = static_cast<float>(random() % 3000) * 1e-3F;
    const LatencyBank::Input input{.sent = sent,
                                   .reading_n = static_cast<float>(random() % 100'000),
                                   .usable = random() % 8 != 0};
    resumed.restore(bank.state());
    const auto out = bank.step(input);
    ASSERT_TRUE(out.latency_s >= 0.0F && out.latency_s <= 0.4F + 1e-5F) << i;
    ASSERT_TRUE(out.misfit_ratio >= 0.0F && out.misfit_ratio <= 1.0F) << i;
    ASSERT_TRUE(host_tests::same_bits(resumed.step(input), out));
    ASSERT_TRUE(host_tests::same_bits(resumed.state(), bank.state()));
  }
  EXPECT_EQ(host_tests::allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::control
