#include "control/jump_resolver.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "support/allocation_count.hpp"
#include "support/same_bits.hpp"

namespace cutforce::control {
namespace {

constexpr JumpResolver::Config kLathe{
    .period_s = 0.05F, .cut_lag_s = 0.1F, .sensor_lag_s = 0.031F, .most_gain_n = 4e5F};
constexpr std::array<double, 3> kOnset{0.05, 0.35, 0.7};

// The cut and the estimate in double precision: F and s of (C74) for a constant mean of v.
struct Response {
  double force = 0.0;
  double sensed = 0.0;

  void run(double length_s, double drive) {
    const double cut_s = static_cast<double>(kLathe.cut_lag_s);
    const double sensor_s = static_cast<double>(kLathe.sensor_lag_s);
    const double e_p = std::exp(-length_s / cut_s);
    const double e_s = std::exp(-length_s / sensor_s);
    const double c_1 = (e_p - e_s) * cut_s / (cut_s - sensor_s);
    sensed = e_s * sensed + c_1 * force + (1.0 - e_s - c_1) * drive;
    force = e_p * force + (1.0 - e_p) * drive;
  }
};

struct Posterior {
  double gain = 0.0, force = 0.0, sensed = 0.0;
  double ff = 0.0, fs = 0.0, fk = 0.0, ss = 0.0, sk = 0.0, kk = 0.0;
};

// (C80)-(C82) as they are printed, over all readings at once, in double precision.
Posterior posterior(const JumpResolver::Point& past,
                    const std::vector<JumpResolver::Reading>& readings, double memory_n) {
  constexpr double kPeriod_s = 0.05;
  const double base_n = static_cast<double>(past.gain_n);
  const bool from_air = base_n <= 0.05 * memory_n;
  const double mu = from_air ? memory_n : 0.0;
  const double variance = from_air ? 2.0 * memory_n * memory_n : base_n * base_n;
  struct Hypothesis {
    double jump, inverse, fit, prior;
    Response h;
  };
  std::vector<Hypothesis> all;
  Response base{static_cast<double>(past.force_n), static_cast<double>(past.sensed_n)};
  std::vector<double> residual;
  double nothing = 0.0;
  for (const auto& r : readings) {
    base.run(kPeriod_s, base_n * static_cast<double>(r.feed));
    residual.push_back(static_cast<double>(r.reading_n) - base.sensed);
    nothing += residual.back() * residual.back() / static_cast<double>(r.noise_n2);
  }
  for (std::size_t tick = 0; tick < 2; ++tick) {
    for (const double onset : kOnset) {
      Response h;
      double a = 1.0 / variance;
      double b = mu / variance;
      for (std::size_t n = tick; n < readings.size(); ++n) {
        h.run(n == tick ? (1.0 - onset) * kPeriod_s : kPeriod_s,
              static_cast<double>(readings[n].feed));
        a += h.sensed * h.sensed / static_cast<double>(readings[n].noise_n2);
        b += h.sensed * residual[n] / static_cast<double>(readings[n].noise_n2);
      }
      const double d = b / a;
      const double misfit = mu * mu / variance + nothing - a * d * d;
      all.push_back({d, 1.0 / a, misfit + std::log(a * variance), 0.99 / 6.0, h});
    }
  }
  all.push_back({0.0, static_cast<double>(past.variance_n2), nothing, 0.01, {}});
  double best = 1e300;
  for (const auto& h : all) best = std::min(best, h.fit);
  double sum = 0.0;
  for (auto& h : all) sum += h.prior *= std::exp(-0.5 * (h.fit - best));
  Posterior p;
  for (auto& h : all) {
    h.prior /= sum;
    p.gain += h.prior * h.jump;
    p.force += h.prior * h.jump * h.h.force;
    p.sensed += h.prior * h.jump * h.h.sensed;
  }
  for (const auto& h : all) {
    const double f = h.jump * h.h.force - p.force;
    const double s = h.jump * h.h.sensed - p.sensed;
    const double k = h.jump - p.gain;
    p.ff += h.prior * (f * f + h.inverse * h.h.force * h.h.force);
    p.fs += h.prior * (f * s + h.inverse * h.h.force * h.h.sensed);
    p.fk += h.prior * (f * k + h.inverse * h.h.force);
    p.ss += h.prior * (s * s + h.inverse * h.h.sensed * h.h.sensed);
    p.sk += h.prior * (s * k + h.inverse * h.h.sensed);
    p.kk += h.prior * (k * k + h.inverse);
  }
  p.gain += base_n;
  p.force += base.force;
  p.sensed += base.sensed;
  return p;
}

class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  float between(float low, float high) {
    return low + (high - low) * static_cast<float>(engine_() % 100'000) * 1e-5F;
  }
  float normal() {
    float sum = -6.0F;
    for (int k = 0; k < 12; ++k) sum += between(0.0F, 1.0F);
    return sum;
  }

 private:
  std::mt19937 engine_;
};

// A cut at rest and a jump somewhere in the first two ticks.
struct Case {
  JumpResolver::Point past;
  std::vector<JumpResolver::Reading> readings;
};
Case random_case(Random& random, float noise_ratio) {
  const float gain_n = random.between(0.0F, 1.0F) < 0.3F ? 0.0F : random.between(50.0F, 2000.0F);
  const float to_n = random.between(20.0F, 3000.0F);
  const float onset = random.between(0.0F, 2.0F);
  const float first = random.between(0.3F, 1.8F);
  Case made;
  Response cut{static_cast<double>(gain_n * first), static_cast<double>(gain_n * first)};
  const float noise_n2 = std::pow(noise_ratio * std::max(to_n, gain_n), 2.0F) + 0.01F;
  for (int n = 0; n < 5; ++n) {
    const float feed = n == 0 ? first : random.between(0.2F, 1.8F);
    const float before = std::clamp(onset - static_cast<float>(n), 0.0F, 1.0F);
    if (before > 0.0F)
      cut.run(0.05 * static_cast<double>(before), static_cast<double>(gain_n * feed));
    if (before < 1.0F)
      cut.run(0.05 * static_cast<double>(1.0F - before), static_cast<double>(to_n * feed));
    made.readings.push_back(
        {.reading_n = static_cast<float>(cut.sensed) + std::sqrt(noise_n2) * random.normal(),
         .feed = feed,
         .feed_sigma = 0.0F,
         .noise_n2 = noise_n2});
  }
  made.past = {.force_n = gain_n * first,
               .sensed_n = gain_n * first,
               .gain_n = gain_n,
               .feed = first,
               .feed_sigma = 0.0F,
               .reading_n = made.readings[0].reading_n,
               .variance_n2 = 0.01F * gain_n * gain_n};
  made.readings[0].noise_n2 = made.readings[1].noise_n2;
  return made;
}

// Down to a noise of 0.1 % of the force, where sums of squares around anything but the mean would
// be nothing but rounding.
TEST(JumpResolver, IsThePosteriorOfItsEquationsAtAnyNoise) {
  Random random(1);
  double worst_mean = 0.0;
  double worst_spread = 0.0;
  for (int i = 0; i < 3000; ++i) {
    const float noise_ratio = i % 3 == 0 ? 0.001F : i % 3 == 1 ? 0.01F : 0.05F;
    const Case made = random_case(random, noise_ratio);
    const float memory_n = 400.0F;
    JumpResolver resolver(kLathe);
    ForceBelief belief{.gain_n = made.past.gain_n};
    resolver.begin(made.past, made.readings[1], memory_n, belief);
    std::vector<JumpResolver::Reading> seen{made.readings[0], made.readings[1]};
    for (std::size_t n = 2;; ++n) {
      const Posterior p = posterior(made.past, seen, static_cast<double>(memory_n));
      if (p.gain > 0.0) {
        const double deviation_n = std::sqrt(p.kk);
        const auto mean = [&](float got, double wanted, double deviation) {
          worst_mean = std::max(worst_mean, std::abs(static_cast<double>(got) - wanted) /
                                                (deviation + 1e-4 * std::abs(wanted)));
        };
        mean(belief.gain_n, p.gain, deviation_n);
        mean(belief.force_n, p.force, std::sqrt(p.ff));
        mean(belief.sensed_n, p.sensed, std::sqrt(p.ss));
        const auto spread = [&](std::size_t k, double wanted, double scale) {
          worst_spread = std::max(
              worst_spread, std::abs(static_cast<double>(belief.covariance[k]) - wanted) / scale);
        };
        spread(ForceBelief::kFF, p.ff, p.ff);
        spread(ForceBelief::kFs, p.fs, std::sqrt(p.ff * p.ss));
        spread(ForceBelief::kFK, p.fk, std::sqrt(p.ff * p.kk));
        spread(ForceBelief::kSS, p.ss, p.ss);
        spread(ForceBelief::kSK, p.sk, std::sqrt(p.ss * p.kk));
        spread(ForceBelief::kKK, p.kk, p.kk);
      }
      if (n == made.readings.size()) break;
      const auto outcome = resolver.follow(made.past, made.readings[n], memory_n, belief);
      if (outcome != JumpResolver::Outcome::kFollows) break;
      seen.push_back(made.readings[n]);
    }
  }
  RecordProperty("worst_mean_ratio", std::to_string(worst_mean));
  RecordProperty("worst_spread_ratio", std::to_string(worst_spread));
  EXPECT_LT(worst_mean, 0.005);   // of a standard deviation
  EXPECT_LT(worst_spread, 0.03);  // single precision at the least noise
}

TEST(JumpResolver, BeginsAgainWhereNothingExplainsTheReadingsAndGivesUpInTheEnd) {
  JumpResolver resolver(kLathe);
  const JumpResolver::Point past{.force_n = 400.0F,
                                 .sensed_n = 400.0F,
                                 .gain_n = 400.0F,
                                 .feed = 1.0F,
                                 .feed_sigma = 0.0F,
                                 .reading_n = 400.0F,
                                 .variance_n2 = 100.0F};
  ForceBelief belief{.gain_n = 400.0F};
  const auto reading = [](float n) {
    return JumpResolver::Reading{
        .reading_n = n, .feed = 1.0F, .feed_sigma = 0.0F, .noise_n2 = 1.0F};
  };
  resolver.begin(past, reading(3000.0F), 400.0F, belief);
  EXPECT_TRUE(resolver.active());
  EXPECT_TRUE(resolver.rising());
  int again = 0;
  auto outcome = JumpResolver::Outcome::kFollows;
  for (int i = 0; i < 100 && outcome != JumpResolver::Outcome::kGivesUp; ++i) {
    outcome = resolver.follow(past, reading(i % 2 == 0 ? 0.0F : 20'000.0F), 400.0F, belief);
    again += outcome == JumpResolver::Outcome::kBeginsAgain ? 1 : 0;
    EXPECT_GE(belief.gain_n, 0.0F);
    EXPECT_LE(belief.gain_n, kLathe.most_gain_n);
  }
  EXPECT_EQ(again, 4);
  EXPECT_EQ(outcome, JumpResolver::Outcome::kGivesUp);
  EXPECT_FALSE(resolver.active());
}

TEST(JumpResolver, StaysFiniteAndContinuesBitExactlyWithoutAllocating) {
  Random random(2);
  const auto allocations = host_tests::allocation_count();
  for (int i = 0; i < 20'000; ++i) {
    JumpResolver resolver(kLathe);
    const auto size = [&random] { return std::pow(10.0F, random.between(-3.0F, 6.0F)); };
    const float noise_n2 = size();
    const auto reading = [&] {
      return JumpResolver::Reading{.reading_n = size(),
                                   .feed = random.between(0.0F, 3.0F),
                                   .feed_sigma = random.between(0.0F, 1.0F),
                                   .noise_n2 = noise_n2};
    };
    const JumpResolver::Point past{.force_n = size(),
                                   .sensed_n = size(),
                                   .gain_n = i % 3 == 0 ? 0.0F : std::min(size(), 4e5F),
                                   .feed = random.between(0.0F, 3.0F),
                                   .feed_sigma = random.between(0.0F, 1.0F),
                                   .reading_n = size(),
                                   .variance_n2 = size()};
    ForceBelief belief{.gain_n = past.gain_n};
    resolver.begin(past, reading(), 400.0F, belief);
    JumpResolver resumed(kLathe);
    for (int n = 0; n < 4 && resolver.active(); ++n) {
      resumed.restore(resolver.state());
      ForceBelief other = belief;
      const auto now = reading();
      const auto outcome = resolver.follow(past, now, 400.0F, belief);
      ASSERT_EQ(resumed.follow(past, now, 400.0F, other), outcome);
      ASSERT_TRUE(host_tests::same_bits(other, belief));
      ASSERT_TRUE(host_tests::same_bits(resumed.state(), resolver.state()));
      ASSERT_TRUE(std::isfinite(belief.force_n) && std::isfinite(belief.sensed_n));
      ASSERT_TRUE(belief.gain_n >= 0.0F && belief.gain_n <= kLathe.most_gain_n);
      for (const std::size_t k : {ForceBelief::kFF, ForceBelief::kSS, ForceBelief::kKK}) {
        ASSERT_TRUE(belief.covariance[k] >= 0.0F && std::isfinite(belief.covariance[k])) << i;
      }
    }
  }
  EXPECT_EQ(host_tests::allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::control
