#include "control/feed_power.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>

namespace cutforce::control {
namespace {

double error_of(float x, float p) {
  const double exact = std::pow(static_cast<double>(x), static_cast<double>(p));
  return std::abs(static_cast<double>(feed_power(x, p)) / exact - 1.0);
}

TEST(FeedPower, StaysWithinItsBoundOverEveryOverrideAndGain) {
  double worst = 0.0;
  for (const float p : {0.3F, 0.7F, 0.864F, 1.2F, 1.5F, 1.0F / 0.864F, 1.0F / 0.3F}) {
    for (float x = 1e-4F; x < 1e4F; x *= 1.0007F) {
      worst = std::max({worst, error_of(x, p), error_of(x, -p)});
    }
  }
  RecordProperty("worst_ratio", std::to_string(worst));
  EXPECT_LT(worst, 5e-6);
  EXPECT_GT(worst, 1e-6);
}

// Where the exponent and the branch of the logarithm change, on either side of the last bit.
TEST(FeedPower, HasNoStepWhereItsPiecesMeet) {
  for (const float x : {0.25F, 0.5F, 0.70710678F, 1.0F, 1.41421356F, 2.0F, 4.0F}) {
    for (int k = -3; k <= 3; ++k) {
      const auto bits = std::bit_cast<std::uint32_t>(x) + static_cast<std::uint32_t>(k);
      EXPECT_LT(error_of(std::bit_cast<float>(bits), 0.864F), 5e-6) << x << " " << k;
    }
  }
  for (float x = 0.5F; x < 2.0F; x *= 1.01F) {
    EXPECT_LT(feed_power(x, 0.864F), feed_power(1.01F * x, 0.864F));
  }
}

TEST(FeedPower, IsExactForAPowerOfOneAndBoundedForAnyOther) {
  EXPECT_EQ(feed_power(0.123456F, 1.0F), 0.123456F);
  EXPECT_NEAR(feed_power(1.0F, 0.864F), 1.0F, 1e-6F);
  for (const float x : {1.2e-38F, 1e-20F, 1e20F, 3e38F}) {
    for (const float p : {-3.4F, -1.0F, 0.3F, 3.4F}) {
      const float y = feed_power(x, p);
      EXPECT_TRUE(std::isnormal(y) && y > 0.0F) << x << " " << p;
    }
  }
}

}  // namespace
}  // namespace cutforce::control
