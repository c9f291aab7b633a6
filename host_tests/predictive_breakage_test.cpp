// FAULTS row 17 at the predictive law: a force that vanishes in the cut is a broken tool until
// proved otherwise.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "support/predictive_lathe.hpp"

namespace cutforce::host_tests {
namespace {

// 20 ms after the breakage the reading of the lathe is 5 % down, 2.3 of its standard deviations.
constexpr double kBlind_s = 0.02;

struct Breakage {
  int blind = 0;      // rises with a reading before that: nobody could know
  int first = 0;      // with the first reading after it
  int later = 0;      // with any other within half a second
  double most = 1.0;  // highest override of that time over the one before
};

// A steady cut of random depth; the tool breaks at a random moment and `left` of it cuts on. Over
// time, not over position, so that no answer moves the moment.
Breakage break_a_tool(std::uint32_t seed, double left) {
  std::mt19937 random(seed);
  const auto uniform = [&random] { return static_cast<double>(random() % 100'000U) / 1e5; };
  const double depth_m = (0.7 + 2.8 * uniform()) * 1e-3;
  const double break_s = 4.0 + 0.5 * uniform();
  auto part = lathe_part(hal::host::Profile(depth_m), 1.0);
  part.process.wear_ratio = {{0.0, 1.0}, {break_s, 1.0}, {break_s, left}};
  part.starts_in_cut = true;
  add_noise(part, seed + 1U);
  auto path = PredictivePath::make(predictive_path(kPredictiveLathe)).value();
  Breakage result;
  double sent_pct = 0.0;
  double intact_pct = 0.0;
  int readings = 0;
  for (const LatheTick& tick : cut(path, part, break_s + 0.5)) {
    const double now_pct = tick.output.override_pct;
    const double after_s = tick.before.time_s - break_s;
    if (after_s <= 0.0) {
      intact_pct = now_pct;
    } else {
      if (after_s >= kBlind_s) ++readings;
      if (now_pct > sent_pct)
        ++(readings == 0 ? result.blind : readings == 1 ? result.first : result.later);
      result.most = std::max(result.most, now_pct / intact_pct);
    }
    sent_pct = now_pct;
  }
  return result;
}

Breakage break_tools(std::uint32_t count, double left) {
  Breakage sum;
  for (std::uint32_t seed = 0; seed < count; ++seed) {
    const Breakage one = break_a_tool(seed, left);
    sum.blind += one.blind;
    sum.first += one.first;
    sum.later += one.later;
    sum.most = std::max(sum.most, one.most);
  }
  testing::Test::RecordProperty("rises_blind", sum.blind);
  testing::Test::RecordProperty("rises_first", sum.first);
  testing::Test::RecordProperty("rises_later", sum.later);
  testing::Test::RecordProperty("most_ratio", std::to_string(sum.most));
  return sum;
}

// What no reading tells yet cannot be forbidden but by never rising at all; it is counted, and it
// is the small correction of a calm cut.
TEST(PredictiveBreakage, DoesNotRaiseTheOverrideForHalfASecondAfterABreakage) {
  const Breakage rises = break_tools(1000, 0.0);
  EXPECT_EQ(rises.later, 0);
  EXPECT_LE(rises.first, 2);
  EXPECT_LE(rises.blind, 20);
  EXPECT_LT(rises.most, 1.08);
}

// A stump that rubs on at a tenth of the force is as broken; its force falls a tenth less, so the
// first reading tells less.
TEST(PredictiveBreakage, DoesNotSpeedUpOnAStumpThatRubsOn) {
  const Breakage rises = break_tools(1000, 0.1);
  EXPECT_EQ(rises.later, 0);
  EXPECT_LE(rises.first, 5);
  EXPECT_LT(rises.most, 1.08);
}

// And a cut that becomes lighter by half is one: the override follows within the half second.
TEST(PredictiveBreakage, FollowsACutThatBecomesLighter) {
  int followed = 0;
  for (std::uint32_t seed = 0; seed < 100; ++seed) {
    if (break_a_tool(seed, 0.5).most > 1.3) ++followed;
  }
  RecordProperty("followed", followed);
  EXPECT_GE(followed, 90);
}

}  // namespace
}  // namespace cutforce::host_tests
