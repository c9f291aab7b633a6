#include "estimator/polynomials.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>

#include "support/allocation_count.hpp"
#include "support/random_float.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::angle_of;
using estimator::atan_small;
using estimator::cos_small;
using estimator::cosine_sine;
using estimator::exp2_coarse;
using estimator::exp_bounded;
using estimator::log_positive;
using estimator::sin_small;
using estimator::tan_over_x;

// Every float of the range in a fast build, every 251st where the sanitizers slow it down.
#ifdef NDEBUG
constexpr std::uint32_t kStride = 1;
#else
constexpr std::uint32_t kStride = 251;
#endif

enum class Kind : std::uint8_t { kAbsolute, kRelative };

// Largest error over the floats from `from` to `to`, both positive, the library's double being
// true.
template <class Ours, class True>
double worst_error(float from, float to, std::uint32_t stride, Kind kind, Ours ours, True is) {
  double worst = 0.0;
  const auto end = std::bit_cast<std::uint32_t>(to);
  for (auto bits = std::bit_cast<std::uint32_t>(from); bits <= end; bits += stride) {
    const auto x = std::bit_cast<float>(bits);
    const double truth = is(static_cast<double>(x));
    double error = std::abs(static_cast<double>(ours(x)) - truth);
    if (kind == Kind::kRelative && truth != 0.0) error /= std::abs(truth);
    if (!(error <= worst)) worst = error;
  }
  return worst;
}

// The two topmost octaves, where an absolute error is largest, and all that is below more coarsely.
template <class Ours, class True>
double worst_up_to(float to, Kind kind, Ours ours, True is) {
  return std::max(worst_error(0.25F * to, to, kStride, kind, ours, is),
                  worst_error(1e-30F, 0.25F * to, 997, kind, ours, is));
}

// Bounds as stated in the header, held from below too, so that they stay honest numbers.
#define EXPECT_BOUND(error, bound)      \
  do {                                  \
    const double measured = (error);    \
    EXPECT_LE(measured, (bound));       \
    EXPECT_GT(measured, 0.7 * (bound)); \
  } while (false)

TEST(Polynomials, AtanStaysWithinItsBound) {
  EXPECT_BOUND(
      worst_up_to(0.41421356F, Kind::kAbsolute, atan_small, [](double x) { return std::atan(x); }),
      3e-8);
}

TEST(Polynomials, TanStaysWithinItsBound) {
  EXPECT_BOUND(
      worst_up_to(1.0F, Kind::kRelative, tan_over_x, [](double x) { return std::tan(x) / x; }),
      4e-7);
  EXPECT_EQ(tan_over_x(0.0F), 1.0F);
  EXPECT_EQ(tan_over_x(-0.7F), tan_over_x(0.7F));
}

TEST(Polynomials, SineAndCosineStayWithinTheirBound) {
  const auto sine = [](double x) { return std::sin(x); };
  const auto cosine = [](double x) { return std::cos(x); };
  EXPECT_LE(worst_up_to(0.8F, Kind::kAbsolute, sin_small, sine), 8e-8);
  EXPECT_BOUND(worst_up_to(0.8F, Kind::kAbsolute, cos_small, cosine), 8e-8);
  EXPECT_EQ(sin_small(-0.7F), -sin_small(0.7F));
  const float pi = std::numbers::pi_v<float>;
  EXPECT_LE(worst_up_to(
                pi, Kind::kAbsolute, [](float x) { return cosine_sine(x).sine; }, sine),
            1e-6);
  EXPECT_LE(worst_up_to(
                pi, Kind::kAbsolute, [](float x) { return cosine_sine(x).cosine; }, cosine),
            1e-6);
}

TEST(Polynomials, ExponentialStaysWithinItsBoundOnBothSides) {
  EXPECT_BOUND(
      worst_up_to(87.0F, Kind::kRelative, exp_bounded, [](double x) { return std::exp(x); }), 9e-8);
  EXPECT_BOUND(worst_up_to(
                   87.0F, Kind::kRelative, [](float x) { return exp_bounded(-x); },
                   [](double x) { return std::exp(-x); }),
               9e-8);
}

TEST(Polynomials, CoarsePowerOfTwoStaysWithinItsBoundOnBothSides) {
  const auto power = [](double x) { return std::exp2(x); };
  EXPECT_BOUND(worst_up_to(120.0F, Kind::kRelative, exp2_coarse, power), 8e-5);
  EXPECT_BOUND(worst_up_to(
                   120.0F, Kind::kRelative, [](float x) { return exp2_coarse(-x); },
                   [](double x) { return std::exp2(-x); }),
               8e-5);
  EXPECT_TRUE(std::isnormal(exp2_coarse(-120.0F)) && std::isfinite(exp2_coarse(120.0F)));
}

// Of vectors that follow one another the octant is not looked for: no bit may differ.
TEST(Polynomials, AngleOfNearVectorsIsThatOfTheOctant) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> draw(-0.4142F, 0.4142F);
  for (int k = 0; k < 200'000; ++k) {
    const float y = draw(random);
    ASSERT_EQ(angle_of(1.0F, y), atan_small(y));
  }
}

TEST(Polynomials, ExponentialIsClampedAndNeverInfinite) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  EXPECT_EQ(exp_bounded(0.0F), 1.0F);
  EXPECT_EQ(exp_bounded(kInfinity), exp_bounded(87.0F));
  EXPECT_EQ(exp_bounded(-kInfinity), exp_bounded(-87.0F));
  EXPECT_TRUE(std::isnormal(exp_bounded(-87.0F)));
  EXPECT_EQ(exp_bounded(NAN), exp_bounded(-87.0F));
}

TEST(Polynomials, LogarithmStaysWithinItsBoundOverAllNormalNumbers) {
  const auto log = [](double x) { return std::log(x); };
  const float least = std::numeric_limits<float>::min();
  const float most = std::numeric_limits<float>::max();
  EXPECT_BOUND(worst_error(0.25F, 4.0F, kStride, Kind::kRelative, log_positive, log), 9e-8);
  EXPECT_LE(worst_error(least, most, 997, Kind::kRelative, log_positive, log), 9e-8);
  EXPECT_EQ(log_positive(1.0F), 0.0F);
}

TEST(Polynomials, AngleStaysWithinItsBoundAtAnyLength) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> turn(-std::numbers::pi, std::numbers::pi);
  std::uniform_real_distribution<double> octave(-60.0, 60.0);
  double worst = 0.0;
  for (int k = 0; k < 1'000'000; ++k) {
    const double length = std::exp2(octave(random));
    const double angle = turn(random);
    const auto x = static_cast<float>(length * std::cos(angle));
    const auto y = static_cast<float>(length * std::sin(angle));
    const double truth = std::atan2(static_cast<double>(y), static_cast<double>(x));
    worst = std::max(worst, std::abs(static_cast<double>(angle_of(x, y)) - truth));
  }
  EXPECT_BOUND(worst, 3e-7);
}

TEST(Polynomials, AngleKnowsTheAxesAndTheNullVector) {
  constexpr float kPi = std::numbers::pi_v<float>;
  EXPECT_EQ(angle_of(0.0F, 0.0F), 0.0F);
  EXPECT_EQ(angle_of(-0.0F, -0.0F), 0.0F);
  EXPECT_EQ(angle_of(2.0F, 0.0F), 0.0F);
  EXPECT_EQ(angle_of(-2.0F, 0.0F), kPi);
  EXPECT_EQ(angle_of(-2.0F, -0.0F), kPi);  // (-pi, pi]: the half axis belongs to +pi
  EXPECT_EQ(angle_of(0.0F, 3.0F), 0.5F * kPi);
  EXPECT_EQ(angle_of(0.0F, -3.0F), -0.5F * kPi);
  EXPECT_FLOAT_EQ(angle_of(1e38F, -1e38F), -0.25F * kPi);
}

// What a compiler computes and what the machine computes must be one: the core is built for both.
static_assert(exp_bounded(0.0F) == 1.0F);
static_assert(angle_of(1.0F, 1.0F) > 0.785398F && angle_of(1.0F, 1.0F) < 0.785399F);

TEST(Polynomials, TakeAnyFloatWithoutLeavingTheirRange) {
  std::mt19937 random(2);
  const auto allocations = allocation_count();
  for (int k = 0; k < 200'000; ++k) {
    const float x = any_float(random);
    const float y = any_float(random);
    const float e = exp_bounded(x);
    ASSERT_TRUE(e > 0.0F && std::isfinite(e)) << x;
    const float angle = angle_of(x, y);
    if (std::isfinite(x) && std::isfinite(y)) {
      ASSERT_LE(std::abs(angle), 3.1415930F) << x << ' ' << y;
    }
    if (std::isnormal(x) && x > 0.0F) {
      ASSERT_LT(std::abs(log_positive(x)), 89.0F) << x;
    }
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
