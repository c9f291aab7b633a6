#include "estimator/speed_table.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace cutforce::host_tests {
namespace {

using estimator::SpeedLines;
using estimator::SpeedTable;

constexpr SpeedTable kTable{.speed_rad_s = {10.0F, 50.0F, 200.0F}, .value = {1.0F, -3.0F, 0.5F}};

static_assert(SpeedLines(kTable).at(10.0F) == 1.0F);
static_assert(SpeedLines(kTable).at(-30.0F) == -1.0F);

TEST(SpeedLines, PassesThroughItsSupportPointsAndIsHeldBeyondTheEnds) {
  const SpeedLines lines(kTable);
  for (const float sign : {1.0F, -1.0F}) {
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(lines.at(sign * kTable.speed_rad_s[k]), kTable.value[k]);
    }
    EXPECT_EQ(lines.at(sign * 0.0F), 1.0F);
    EXPECT_EQ(lines.at(sign * 9.0F), 1.0F);
    EXPECT_EQ(lines.at(sign * 1e30F), 0.5F);
    EXPECT_EQ(lines.at(sign * std::numeric_limits<float>::infinity()), 0.5F);
  }
  // What is no speed reads the first value, as standstill does.
  EXPECT_EQ(lines.at(std::numeric_limits<float>::quiet_NaN()), 1.0F);
}

TEST(SpeedLines, IsStraightBetweenThem) {
  const SpeedLines lines(kTable);
  for (int k = 0; k <= 100; ++k) {
    const float share = 0.01F * static_cast<float>(k);
    EXPECT_NEAR(lines.at(10.0F + 40.0F * share), 1.0F - 4.0F * share, 1e-5F);
    EXPECT_NEAR(lines.at(50.0F + 150.0F * share), -3.0F + 3.5F * share, 1e-5F);
  }
}

TEST(SpeedLines, IsExactlyItsValueWhereItIsLevel) {
  const SpeedLines lines({.speed_rad_s = kTable.speed_rad_s, .value = {0.1F, 0.1F, 0.1F}});
  std::mt19937 random(1);
  for (int run = 0; run < 100'000; ++run) {
    const float speed = static_cast<float>(random() % 3'000'000) * 1e-4F;
    ASSERT_EQ(lines.at(speed), 0.1F);
    ASSERT_EQ(lines.at(lines.place(speed)), 0.1F);
  }
}

TEST(SpeedLines, SharesItsPlacesWithTablesOfTheSameSpeedsOnly) {
  const SpeedLines lines(kTable);
  SpeedTable other{.speed_rad_s = kTable.speed_rad_s, .value = {7.0F, 8.0F, 11.0F}};
  const SpeedLines same(other);
  EXPECT_TRUE(lines.has_places_of(same));
  for (int k = 0; k < 3000; ++k) {
    const float speed = 0.1F * static_cast<float>(k);
    ASSERT_EQ(same.at(lines.place(speed)), same.at(speed));
  }
  other.speed_rad_s[1] = 50.5F;
  EXPECT_FALSE(lines.has_places_of(SpeedLines(other)));
}

}  // namespace
}  // namespace cutforce::host_tests
