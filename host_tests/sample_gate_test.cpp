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

#if __has_include("support/allocation_count.hpp")
#include "support/allocation_count.hpp"
#define CUTFORCE_COUNTS_ALLOCATIONS
#endif

namespace cutforce {
namespace {

using estimator::Fault;
using estimator::SampleGate;
using Verdict = SampleGate::Verdict;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr std::int64_t kMs = 1'000'000;

constexpr SampleGate::Config kGate{.sample_period_s = 1e-3F,
                                   .voltage_limit_v = 800.0F,
                                   .current_limit_a = 30.0F,
                                   .speed_limit_rad_s = 1000.0F,
                                   .power_limit_w = 20000.0F,
                                   .gap_limit_s = 0.1F,
                                   .bridge_limit = 2,
                                   .clock_limit = 50};
static_assert(kGate.check());

SampleGate::Input good(std::int64_t time_ns, float level = 1.0F) {
  return {.time_ns = time_ns,
          .values = {.voltage_v = {300.0F * level, -100.0F, -200.0F},
                     .current_a = {5.0F * level, -2.0F, -3.0F},
                     .speed_rad_s = 157.0F,
                     .power_w = 1000.0F},
          .present = SampleGate::kSpeed | SampleGate::kPower};
}

std::array<float, 8> flat(const SampleGate::Values& v) {
  return {v.voltage_v[0], v.voltage_v[1], v.voltage_v[2], v.current_a[0],
          v.current_a[1], v.current_a[2], v.speed_rad_s,  v.power_w};
}

void set(SampleGate::Values& v, std::size_t k, float x) {
  if (k < 3)
    v.voltage_v[k] = x;
  else if (k < 6)
    v.current_a[k - 3] = x;
  else if (k == 6)
    v.speed_rad_s = x;
  else
    v.power_w = x;
}

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

// A source of samples that does everything wrong that a source can.
class Vandal {
 public:
  explicit Vandal(unsigned seed) : random_(seed) {}

  SampleGate::Input next() {
    SampleGate::Input in = good(time_ns_, unit());
    const double dice = uniform_(random_);
    if (dice < 0.80)
      time_ns_ += kMs;
    else if (dice < 0.90)
      time_ns_ += static_cast<std::int64_t>(uniform_(random_) * 3e6);
    else if (dice < 0.97)
      time_ns_ += static_cast<std::int64_t>(uniform_(random_) * 20e6);
    else if (dice < 0.98)
      time_ns_ += static_cast<std::int64_t>(uniform_(random_) * 10e9);
    in.time_ns = time_ns_;
    in.present = static_cast<std::uint32_t>(random_() % 4);
    while (uniform_(random_) < 0.3) set(in.values, random_() % 8, rubbish());
    return in;
  }

  SampleGate::Input misplaced(const SampleGate::Input& last) {
    SampleGate::Input in = next_values(last);
    if (random_() % 2 == 0) in.time_ns -= static_cast<std::int64_t>(random_() % 1000000);
    return in;
  }

  bool sometimes(double share) { return uniform_(random_) < share; }

 private:
  SampleGate::Input next_values(const SampleGate::Input& last) {
    SampleGate::Input in = last;
    set(in.values, random_() % 8, rubbish());
    return in;
  }
  float unit() { return static_cast<float>(uniform_(random_)); }
  float rubbish() { return std::bit_cast<float>(static_cast<std::uint32_t>(random_())); }

  std::mt19937 random_;
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
  std::int64_t time_ns_ = 0;
};

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

struct Row {
  std::int64_t time_ns;
  std::array<float, 3> voltage_v;
  std::array<float, 3> current_a;
  float speed_rad_s;
  float power_meter_w;
  std::uint32_t present;  // with the gate's bits from bit 6 on
};

Row row_of(const SampleGate::Input& in) {
  return {.time_ns = in.time_ns,
          .voltage_v = in.values.voltage_v,
          .current_a = in.values.current_a,
          .speed_rad_s = in.values.speed_rad_s,
          .power_meter_w = in.values.power_w,
          .present = in.present << 6U};
}

// Whether one comparison clears three channels (E9): two of them at 0.8 of their range are usable,
// but have to be looked at one by one.
bool cleared_at_once(const SampleGate::Values& v) {
  const auto below = [](const std::array<float, 3>& x, float limit) {
    return std::hypot(x[0], x[1], x[2]) < 0.9979F * limit;
  };
  return below(v.voltage_v, kGate.voltage_limit_v) && below(v.current_a, kGate.current_limit_a);
}

// A run is worth nothing if it lets one sample pass that step() would bridge, drop or report, and
// little if it stops at one that step() accepts without a word.
TEST(SampleGate, AcceptsInARunWhatItAcceptsOneByOne) {
  Vandal vandal(10);
  std::mt19937 random(11);
  auto singly = SampleGate::make(kGate).value();
  auto in_runs = SampleGate::make(kGate).value();
  std::size_t accepted_in_runs = 0;
  for (int block = 0; block < 100'000; ++block) {
    std::vector<SampleGate::Input> inputs;
    std::generate_n(std::back_inserter(inputs), 1 + random() % 9, [&] { return vandal.next(); });
    std::vector<Row> rows;
    std::ranges::transform(inputs, std::back_inserter(rows), row_of);
    for (std::size_t at = 0; at < rows.size();) {
      std::size_t taken = 0;
      in_runs.accept_run<6>(std::span<const Row>(rows).subspan(at), [&](const Row& row) {
        ASSERT_EQ(row.time_ns, rows[at + taken].time_ns);
        ++taken;
      });
      for (std::size_t k = at; k < at + taken; ++k) {
        const auto out = singly.step(inputs[k]);
        ASSERT_EQ(out.verdict, Verdict::kAccept);
        ASSERT_TRUE(out.faults.empty());
        ASSERT_EQ(out.elapsed_periods, 1.0F);
        ASSERT_EQ(out.at_end_channels, 0U);
        ASSERT_EQ(out.present, inputs[k].present);
      }
      accepted_in_runs += taken;
      at += taken;
      if (at == rows.size()) break;
      const bool like_the_run = taken == 0 || inputs[at].present == inputs[at - 1].present;
      const bool could_go_on = in_runs.state().unusual == 0 && like_the_run &&
                               inputs[at].present == (SampleGate::kSpeed | SampleGate::kPower) &&
                               cleared_at_once(inputs[at].values);
      const auto a = singly.step(inputs[at]);
      const bool usual = a.verdict == Verdict::kAccept && a.faults.empty() &&
                         a.elapsed_periods == 1.0F && a.at_end_channels == 0;
      ASSERT_FALSE(could_go_on && usual) << block;
      const auto b = in_runs.step(inputs[at]);
      ASSERT_EQ(a.verdict, b.verdict);
      ++at;
    }
    ASSERT_EQ(std::memcmp(&singly.state(), &in_runs.state(), sizeof(SampleGate::State)), 0)
        << block;
  }
  EXPECT_GT(accepted_in_runs, 50'000);
}

TEST(SampleGate, StopsARunAtTheFirstSampleThatIsNotUsual) {
  constexpr std::size_t kRows = 5;
  for (std::size_t bad = 0; bad < kRows; ++bad) {
    for (int way = 0; way < 6; ++way) {
      auto gate = SampleGate::make(kGate).value();
      std::ignore = gate.step(good(0));
      std::vector<Row> rows;
      for (std::size_t k = 0; k < kRows; ++k)
        rows.push_back(row_of(good(static_cast<std::int64_t>(k + 1) * kMs)));
      Row& row = rows[bad];
      if (way == 0) row.voltage_v[2] = -kNan;
      if (way == 1) row.current_a[1] = 29.99F;  // at its end
      if (way == 2) row.time_ns += std::int64_t{1} << 32U;
      if (way == 3) row.time_ns -= kMs / 50;
      if (way == 4) row.power_meter_w = -20001.0F;
      if (way == 5) row.present &= ~(SampleGate::kSpeed << 6U);
      std::size_t taken = 0;
      gate.accept_run<6>(std::span<const Row>(rows), [&](const Row&) { ++taken; });
      // What a whole run lacks is held against none of it, unless a value is there all the same.
      const std::size_t expected = way == 5 && bad == 0 ? 0 : bad;
      ASSERT_EQ(taken, expected) << "row " << bad << ", way " << way;
      ASSERT_EQ(gate.state().last_time_ns, static_cast<std::int64_t>(expected) * kMs);
    }
  }
}

TEST(SampleGate, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  Vandal vandal(9);
  auto original = SampleGate::make(kGate).value();
  auto resumed = SampleGate::make(kGate).value();
#ifdef CUTFORCE_COUNTS_ALLOCATIONS
  const auto allocations = host_tests::allocation_count();
#endif
  for (int n = 0; n < 20000; ++n) {
    resumed.restore(original.state());
    const auto in = vandal.next();
    ASSERT_TRUE(bits_equal(step(original, in), step(resumed, in))) << n;
  }
#ifdef CUTFORCE_COUNTS_ALLOCATIONS
  EXPECT_EQ(host_tests::allocation_count(), allocations);
#endif
}

}  // namespace
}  // namespace cutforce
