#include "estimator/sample_gate.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <limits>
#include <random>
#include <span>
#include <tuple>
#include <vector>

#include "support/allocation_count.hpp"
#include "support/spoiled_samples.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::Fault;
using Verdict = SampleGate::Verdict;

// What the gate says and what it lets through.
struct Step {
  SampleGate::Output out;
  SampleGate::Values values;
};

Step step(SampleGate& gate, const SampleGate::Input& in) {
  const auto out = gate.step(in);
  return {out, gate.values()};
}

bool bits_equal(const Step& first, const Step& second) {
  const auto& a = first.out;
  const auto& b = second.out;
  return a.verdict == b.verdict && a.faults == b.faults && a.present == b.present &&
         a.missing_samples == b.missing_samples && a.at_end_channels == b.at_end_channels &&
         std::bit_cast<std::uint32_t>(a.elapsed_periods) ==
             std::bit_cast<std::uint32_t>(b.elapsed_periods) &&
         std::bit_cast<std::array<std::uint32_t, 8>>(first.values) ==
             std::bit_cast<std::array<std::uint32_t, 8>>(second.values);
}

TEST(SampleGate, MeasuresTimeInNominalPeriodsExactlyOneWhenNominal) {
  auto gate = SampleGate::make(kGate).value();
  EXPECT_EQ(gate.step(good(5)).verdict, Verdict::kAccept);
  std::int64_t t = 5;
  const auto after = [&](std::int64_t ns) { return gate.step(good(t += ns)); };
  for (const std::int64_t ns : {990'000, 995'000, 1'000'000, 1'010'000}) {
    const auto out = after(ns);
    EXPECT_EQ(out.elapsed_periods, 1.0F) << ns;
    EXPECT_TRUE(out.faults.empty());
  }
  EXPECT_FLOAT_EQ(after(989'999).elapsed_periods, 1014.0F / 1024.0F);
  EXPECT_FLOAT_EQ(after(1'400'000).elapsed_periods, 1434.0F / 1024.0F);
  EXPECT_TRUE(after(1'500'000).faults.empty());
  for (const std::int64_t n : {2, 3, 17, 100}) {
    const auto out = after(n * kMs);
    EXPECT_EQ(out.verdict, Verdict::kAccept);
    EXPECT_TRUE(out.faults.contains(Fault::kGap));
    EXPECT_FLOAT_EQ(out.elapsed_periods, static_cast<float>(n));
    EXPECT_EQ(out.missing_samples, n - 1);
  }
  const auto out = after(101 * kMs);
  EXPECT_EQ(out.verdict, Verdict::kRestart);
  EXPECT_EQ(out.elapsed_periods, 1.0F);
}

TEST(SampleGate, BridgesTwoBadSamplesAndDropsTheThirdForEachWayToBeBad) {
  for (std::size_t k = 0; k < 6; ++k) {
    const float limit = k < 3 ? 800.0F : 30.0F;
    for (const float bad : {kNan, -kNan, kInf, -kInf, 1.0001F * limit, -3e38F}) {
      SCOPED_TRACE(testing::Message() << "channel " << k << " = " << bad);
      auto gate = SampleGate::make(kGate).value();
      (void)gate.step(good(0, 0.5F));
      for (int n = 1; n <= 5; ++n) {
        SampleGate::Input in = good(n * kMs);
        set(in.values, k, bad);
        const auto out = gate.step(in);
        EXPECT_EQ(out.verdict, n <= 2 ? Verdict::kBridge : Verdict::kDrop);
        EXPECT_EQ(out.faults.contains(Fault::kNonFinite), !std::isfinite(bad));
        EXPECT_EQ(out.faults.contains(Fault::kOutOfRange), std::isfinite(bad));
        EXPECT_EQ(gate.values().voltage_v[0], 150.0F);
      }
      const auto out = gate.step(good(6 * kMs));
      EXPECT_EQ(out.verdict, Verdict::kAccept);
      EXPECT_FLOAT_EQ(out.elapsed_periods, 4.0F);  // the bridged ones counted as time that passed
      EXPECT_TRUE(out.faults.contains(Fault::kGap));
    }
  }
}

TEST(SampleGate, AcceptsWhatLiesAtTheLimitAndNothingBeyond) {
  auto gate = SampleGate::make(kGate).value();
  SampleGate::Input in = good(0);
  in.values.voltage_v = {800.0F, -800.0F, 800.0F};
  in.values.current_a = {-30.0F, 30.0F, 30.0F};
  const auto out = gate.step(in);
  EXPECT_EQ(out.verdict, Verdict::kAccept);
  EXPECT_EQ(out.at_end_channels, 0b111111U);
  in.time_ns += kMs;
  in.values.current_a[1] = std::nextafter(30.0F, 31.0F);
  EXPECT_EQ(gate.step(in).verdict, Verdict::kBridge);
}

TEST(SampleGate, ReportsExactlyTheChannelsAtTheirEnds) {
  for (unsigned k = 0; k < 6; ++k) {
    const float limit = k < 3 ? 800.0F : 30.0F;
    for (const float sign : {1.0F, -1.0F}) {
      auto gate = SampleGate::make(kGate).value();
      SampleGate::Input in = good(0, 0.0F);
      set(in.values, k, sign * limit * 2047.0F / 2048.0F);
      EXPECT_EQ(gate.step(in).at_end_channels, 1U << k);
      in.time_ns += kMs;
      set(in.values, k, sign * limit * 0.997F);
      EXPECT_EQ(gate.step(in).at_end_channels, 0U);
    }
  }
}

TEST(SampleGate, BridgesASlowValueAloneThenSaysItIsNotThere) {
  for (const std::uint32_t which : {SampleGate::kSpeed, SampleGate::kPower}) {
    auto gate = SampleGate::make(kGate).value();
    (void)gate.step(good(0));
    for (int n = 1; n <= 4; ++n) {
      SampleGate::Input in = good(n * kMs);
      set(in.values, which == SampleGate::kSpeed ? 6 : 7, n % 2 == 0 ? kNan : 1e8F);
      const auto out = gate.step(in);
      EXPECT_EQ(out.verdict, Verdict::kAccept);
      EXPECT_FALSE(out.faults.empty());
      EXPECT_EQ((out.present & which) != 0, n <= 2);
      EXPECT_NE(out.present & ~which, 0U);
    }
    EXPECT_EQ(gate.step(good(5 * kMs)).present, SampleGate::kSpeed | SampleGate::kPower);
  }
}

TEST(SampleGate, NeverReadsWhatIsNotPresent) {
  auto gate = SampleGate::make(kGate).value();
  SampleGate::Input in = good(0);
  in.present = 0;
  in.values.speed_rad_s = kNan;
  in.values.power_w = kInf;
  const auto out = gate.step(in);
  EXPECT_EQ(out.verdict, Verdict::kAccept);
  EXPECT_TRUE(out.faults.empty());
  EXPECT_EQ(out.present, 0U);
  EXPECT_EQ(gate.values().speed_rad_s, 0.0F);
}

TEST(SampleGate, FollowsAClockThatWasSetBackOnlyAfterItHasShownItself) {
  auto gate = SampleGate::make(kGate).value();
  (void)gate.step(good(1'000'000 * kMs));
  for (int n = 1; n <= 50; ++n) EXPECT_EQ(gate.step(good(n * kMs)).verdict, Verdict::kDrop);
  EXPECT_EQ(gate.step(good(51 * kMs)).verdict, Verdict::kRestart);
  EXPECT_EQ(gate.step(good(52 * kMs)).verdict, Verdict::kAccept);

  auto stubborn = kGate;
  stubborn.clock_limit = 0;
  auto never = SampleGate::make(stubborn).value();
  (void)never.step(good(1'000'000 * kMs));
  for (int n = 1; n <= 5000; ++n) ASSERT_EQ(never.step(good(n * kMs)).verdict, Verdict::kDrop);
}

TEST(SampleGate, SurvivesTheEndsOfTime) {
  constexpr auto kFirst = std::numeric_limits<std::int64_t>::min();
  constexpr auto kLast = std::numeric_limits<std::int64_t>::max();
  auto gate = SampleGate::make(kGate).value();
  EXPECT_EQ(gate.step(good(kFirst)).verdict, Verdict::kAccept);
  EXPECT_EQ(gate.step(good(kLast)).verdict, Verdict::kRestart);
  EXPECT_EQ(gate.step(good(kLast)).verdict, Verdict::kDrop);
  EXPECT_EQ(gate.step(good(kFirst)).verdict, Verdict::kDrop);
}

TEST(SampleGate, RefusesWhatCannotBeALimit) {
  using Error = SampleGate::ConfigError;
  const auto error = [](auto change) {
    SampleGate::Config config = kGate;
    change(config);
    return SampleGate::make(config).error();
  };
  for (const float bad : {kNan, kInf, -1.0F, 0.0F, 1e-7F}) {
    EXPECT_EQ(error([&](auto& c) { c.sample_period_s = bad; }), Error::kPeriod);
    EXPECT_EQ(error([&](auto& c) { c.gap_limit_s = bad; }), Error::kGapLimit);
  }
  for (const float bad : {kNan, kInf, -1.0F, 0.0F, 2e9F}) {
    EXPECT_EQ(error([&](auto& c) { c.voltage_limit_v = bad; }), Error::kLimit);
    EXPECT_EQ(error([&](auto& c) { c.current_limit_a = bad; }), Error::kLimit);
    EXPECT_EQ(error([&](auto& c) { c.speed_limit_rad_s = bad; }), Error::kLimit);
    EXPECT_EQ(error([&](auto& c) { c.power_limit_w = bad; }), Error::kLimit);
  }
  EXPECT_EQ(error([](auto& c) { c.gap_limit_s = 2.5F; }), Error::kGapLimit);
  EXPECT_EQ(error([](auto& c) { c.bridge_limit = 2'000'000; }), Error::kBridgeLimit);
  EXPECT_EQ(error([](auto& c) { c.clock_limit = 2'000'000; }), Error::kClockLimit);
}

TEST(SampleGate, NeverLetsAnythingThroughThatIsNotFiniteAndInRange) {
  int accepted = 0;
  int bridged = 0;
  int dropped = 0;
  int restarted = 0;
  Vandal vandal(7);
  auto gate = SampleGate::make(kGate).value();
  std::uint32_t in_a_row = 0;
  for (int n = 0; n < 1'000'000; ++n) {
    const auto out = gate.step(vandal.next());
    const auto values = flat(gate.values());
    for (std::size_t k = 0; k < 8; ++k) {
      const float limit = k < 3 ? 800.0F : k < 6 ? 30.0F : k == 6 ? 1000.0F : 20000.0F;
      ASSERT_LE(std::fabs(values[k]), limit) << n;  // false for NaN
    }
    ASSERT_TRUE(out.elapsed_periods >= 0.0F && out.elapsed_periods <= 100.0F) << n;
    in_a_row = out.verdict == Verdict::kBridge ? in_a_row + 1 : 0;
    ASSERT_LE(in_a_row, kGate.bridge_limit);
    accepted += out.verdict == Verdict::kAccept;
    bridged += out.verdict == Verdict::kBridge;
    dropped += out.verdict == Verdict::kDrop;
    restarted += out.verdict == Verdict::kRestart;
  }
  std::printf("accepted %d, bridged %d, dropped %d, restarted %d: 0 bad values\n", accepted,
              bridged, dropped, restarted);
  EXPECT_GT(std::min({accepted, bridged, dropped, restarted}), 1000);
}

TEST(SampleGate, GivesTheSameBitsWithAMillionMisplacedSamplesAsWithout) {
  Vandal vandal(8);
  auto clean = SampleGate::make(kGate).value();
  auto disturbed = SampleGate::make(kGate).value();
  int misplaced = 0;
  SampleGate::Input last{};
  bool started = false;
  while (misplaced < 1'000'000) {
    const auto in = vandal.next();
    const auto a = step(clean, in);
    const auto b = step(disturbed, in);
    ASSERT_TRUE(bits_equal(a, b)) << misplaced;
    if (a.out.verdict != Verdict::kDrop) {
      last = in;
      started = true;
    }
    for (int n = 0; started && n < 20 && vandal.sometimes(0.95); ++n, ++misplaced) {
      const auto out = disturbed.step(vandal.misplaced(last));
      ASSERT_EQ(out.verdict, Verdict::kDrop);
      ASSERT_TRUE(out.faults.contains(Fault::kTimeOrder));
    }
  }
}

TEST(SampleGate, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  Vandal vandal(9);
  auto original = SampleGate::make(kGate).value();
  auto resumed = SampleGate::make(kGate).value();
  const auto allocations = allocation_count();
  for (int n = 0; n < 20000; ++n) {
    resumed.restore(original.state());
    const auto in = vandal.next();
    ASSERT_TRUE(bits_equal(step(original, in), step(resumed, in))) << n;
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
