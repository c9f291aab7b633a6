#include "estimator/load_torque_filter.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <random>

#include "support/allocation_count.hpp"
#include "support/same_bits.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::LoadTorqueFilter;

constexpr double kRated = 14.6;
constexpr double kInertia = 0.03;
constexpr double kTick = 1e-3;

constexpr LoadTorqueFilter::Config kSpindle{
    .tick_s = 1e-3F, .rated_torque_nm = 14.6F, .edge_slope_1_s = 12.0F, .drift_1_sqrt_s = 0.01F};
static_assert(kSpindle.check());

// Five samples a tick, speed noise white or of an angle.
constexpr LoadTorqueFilter::Noise kWhite{.speed_variance = 2.5e-3F,
                                         .angle_variance = 0.0F,
                                         .torque_variance = 1e-3F,
                                         .centre_ratio = 0.4F};
constexpr LoadTorqueFilter::Noise kCounts{.speed_variance = 1e-9F,
                                          .angle_variance = 0.2F,
                                          .torque_variance = 1e-3F,
                                          .centre_ratio = 0.5F};
constexpr LoadTorqueFilter::Noise kClean{.speed_variance = 1e-9F,
                                         .angle_variance = 0.0F,
                                         .torque_variance = 1e-6F,
                                         .centre_ratio = 0.4F};

// The shaft, with a torque held over each tick and a load that may move, in small steps.
class Shaft {
 public:
  explicit Shaft(double speed) : speed_(speed) {}
  // Returns the mean speed of a tick of n samples; k of (E72) belongs to it.
  double tick(double torque, double load_begin, double load_end, bool of_angle) {
    constexpr int kSamples = 5;
    constexpr int kFine = 20;
    double sampled = 0.0;
    double angle = 0.0;
    for (int j = 0; j < kSamples; ++j) {
      for (int f = 0; f < kFine; ++f) {
        const double at = (j * kFine + f + 0.5) / (kSamples * kFine);
        const double load = load_begin + at * (load_end - load_begin);
        const double step = kTick / (kSamples * kFine);
        angle += step * speed_;
        speed_ += step * (torque - load) / kInertia;
      }
      sampled += speed_ / kSamples;
    }
    return of_angle ? angle / kTick : sampled;
  }
  [[nodiscard]] double speed() const { return speed_; }

 private:
  double speed_;
};

LoadTorqueFilter::Input input_of(double torque, double speed, double centre) {
  return {.torque_nm = static_cast<float>(torque),
          .moment_nm = static_cast<float>(centre * torque),
          .speed_rad_s = static_cast<float>(speed),
          .duration_s = 1e-3F,
          .inertia_kg_m2 = 0.03F,
          .speed_valid = true};
}

// Both models written the textbook way, in matrices and double precision, from (E70)-(E74).
class Reference {
 public:
  struct Model {
    Eigen::Vector3d x = Eigen::Vector3d::Zero();
    Eigen::Matrix3d p = Eigen::Matrix3d::Zero();
    double q = 0.0;
    double residual = 0.0;
    double innovation = 1.0;
  };

  Reference(double speed, double torque) {
    models[0].q = 0.01 * std::sqrt(kTick) * kRated;
    models[1].q = 12.0 * kTick * kRated;
    for (Model& m : models) {
      m.x << 0.0, speed, torque;
      m.p.diagonal() << 0.0, 1.0, kRated * kRated;
    }
  }

  void step(const LoadTorqueFilter::Input& in, const LoadTorqueFilter::Noise& noise) {
    const double edge_prior = edge * 0.97 + (1.0 - edge) * 0.001;
    const Eigen::Vector3d quiet_x = models[0].x;
    const Eigen::Vector3d edge_x = models[1].x;
    models[0].x = (edge * 0.03 * edge_x + (1.0 - edge) * 0.999 * quiet_x) / (1.0 - edge_prior);
    models[1].x = (edge * 0.97 * edge_x + (1.0 - edge) * 0.001 * quiet_x) / edge_prior;
    for (Model& m : models) step(m, in, noise);
    const double likelihood_quiet = likelihood(models[0]);
    const double likelihood_edge = likelihood(models[1]);
    edge = edge_prior * likelihood_edge /
           (edge_prior * likelihood_edge + (1.0 - edge_prior) * likelihood_quiet);
    edge = std::clamp(edge, 1e-4, 1.0 - 1e-4);
  }

  [[nodiscard]] double torque() const {
    return (1.0 - edge) * models[0].x(2) + edge * models[1].x(2);
  }
  [[nodiscard]] double variance() const {
    const double apart = models[1].x(2) - models[0].x(2);
    return (1.0 - edge) * models[0].p(2, 2) + edge * models[1].p(2, 2) +
           edge * (1.0 - edge) * apart * apart;
  }

  std::array<Model, 2> models;
  double edge = 0.5;

 private:
  static double likelihood(const Model& m) {
    return std::exp(-0.5 * m.residual * m.residual / m.innovation) / std::sqrt(m.innovation);
  }

  static void step(Model& m, const LoadTorqueFilter::Input& in,
                   const LoadTorqueFilter::Noise& noise) {
    const double g = static_cast<double>(in.duration_s) / static_cast<double>(in.inertia_kg_m2);
    const double k = static_cast<double>(noise.centre_ratio);
    const double torque = static_cast<double>(in.torque_nm);
    Eigen::Matrix3d f;
    f << 1.0, 1.0, -g * (1.0 - k), 0.0, 1.0, -g, 0.0, 0.0, 1.0;
    Eigen::Vector3d known;
    known << g * torque - g * static_cast<double>(in.moment_nm) -
                 static_cast<double>(in.speed_rad_s),
        g * torque, 0.0;
    Eigen::Matrix3d into;  // of d, torque noise, e
    into << -g * (1.0 - k), g * (1.0 - k), 1.0, -g, g, 0.0, 1.0, 0.0, 0.0;
    const Eigen::Vector3d q(m.q * m.q, static_cast<double>(noise.torque_variance),
                            static_cast<double>(noise.speed_variance));
    m.x = f * m.x + known;
    m.p = f * m.p * f.transpose() + into * q.asDiagonal() * into.transpose();
    const Eigen::RowVector3d h(1.0, 0.0, 0.0);
    const double r = static_cast<double>(noise.angle_variance);
    m.innovation = h * m.p * h.transpose() + r;
    m.residual = -m.x(0);
    const Eigen::Vector3d gain = m.p * h.transpose() / m.innovation;
    m.x += gain * m.residual;
    const Eigen::Matrix3d keep = Eigen::Matrix3d::Identity() - gain * h;
    m.p = keep * m.p * keep.transpose() + r * gain * gain.transpose();
  }
};

TEST(LoadTorqueFilter, AgreesWithAKalmanFilterInMatricesForBothKindsOfNoise) {
  for (const LoadTorqueFilter::Noise& noise : {kWhite, kCounts}) {
    const bool of_angle = noise.angle_variance > 0.0F;
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    auto filter = LoadTorqueFilter::make(kSpindle).value();
    filter.start(150.0F, 1.0F, 2.0F, 14.6F);
    Reference reference(150.0, 2.0);
    Shaft shaft(150.0);
    double angle_noise = 0.0;
    double load = 2.0;
    for (int k = 0; k < 4000; ++k) {
      const double torque = 4.0 + 2.0 * std::sin(0.02 * k);
      const double next = k == 2000 ? 8.0 : load;
      double speed = shaft.tick(torque, load, next, of_angle);
      load = next;
      if (of_angle) {
        const double now = std::sqrt(0.2) * normal(random);
        speed += now - angle_noise;
        angle_noise = now;
      } else {
        speed += 0.05 * normal(random);
      }
      const auto input = input_of(torque + std::sqrt(1e-3) * normal(random), speed,
                                  static_cast<double>(noise.centre_ratio));
      const auto output = filter.step(input, noise);
      reference.step(input, noise);
      // Single precision loses most where the first wide uncertainty collapses.
      const double share = k < 20 ? 3e-3 : 5e-4;
      ASSERT_NEAR(output.load_torque_nm, reference.torque(), share * kRated)
          << of_angle << ' ' << k;
      ASSERT_NEAR(std::sqrt(output.variance_nm2), std::sqrt(reference.variance()), share * kRated)
          << of_angle << ' ' << k;
    }
  }
}

// The recursions run in turns once they have settled; where the noise steps or a start comes in
// between, the filter must not know the difference for long.
TEST(LoadTorqueFilter, KeepsToTheRecursionThatRunsWithEveryTickWhereTheNoiseSteps) {
  std::mt19937 random(17);
  std::normal_distribution<double> normal;
  auto filter = LoadTorqueFilter::make(kSpindle).value();
  filter.start(150.0F, 1.0F, 2.0F, 14.6F);
  Reference reference(150.0, 2.0);
  Shaft shaft(150.0);
  for (int k = 0; k < 6000; ++k) {
    LoadTorqueFilter::Noise noise = kWhite;
    noise.speed_variance *= k / 1000 % 2 == 0 ? 1.0F : 4.0F;
    noise.torque_variance *= k / 1500 % 2 == 0 ? 1.0F : 2.0F;
    const double sigma = std::sqrt(static_cast<double>(noise.speed_variance));
    const double load = 2.0 + std::sin(0.003 * k);
    const double speed = shaft.tick(load, load, load, false) + sigma * normal(random);
    const auto input = input_of(load, speed, 0.4);
    const auto output = filter.step(input, noise);
    reference.step(input, noise);
    // In parts of what the estimate claims to know: settled, gains of up to four ticks ago make no
    // difference to speak of; while they follow a step of the noise, less than half.
    const bool stepped = k % 500 < 200 && k > 500;
    const double known_nm = std::sqrt(reference.variance());
    const double most_nm = (stepped ? 0.5 : 0.05) * known_nm;
    ASSERT_NEAR(output.load_torque_nm, reference.torque(), most_nm) << k;
    ASSERT_NEAR(std::sqrt(output.variance_nm2), known_nm, most_nm) << k;
  }
}

// With R_a = 0 the angle is known with every tick, and what remains is the filter on the speed.
// Its measurement shares torque noise with the prediction, so their covariance is in the gain.
TEST(LoadTorqueFilter, WithoutAngleNoiseIsTheTwoStateFilterOnSpeed) {
  auto config = kSpindle;
  config.edge_slope_1_s = 12.0F;
  config.drift_1_sqrt_s = 12.0F * std::sqrt(1e-3F);  // both models alike: no mixture
  auto filter = LoadTorqueFilter::make(config).value();
  filter.start(150.0F, 1.0F, 2.0F, 14.6F);
  Eigen::Vector2d x(150.0, 2.0);
  Eigen::Matrix2d p;
  p << 1.0, 0.0, 0.0, kRated * kRated;
  const double g = kTick / kInertia;
  const double k = 0.4;
  const double q = 12.0 * kTick * kRated;
  std::mt19937 random(12);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 2000; ++n) {
    const double torque = 3.0 + normal(random);
    const auto input = input_of(torque, 150.0 + 0.05 * normal(random), k);
    const auto output = filter.step(input, kWhite);

    Eigen::Matrix2d f;
    f << 1.0, -g, 0.0, 1.0;
    const Eigen::Vector2d drift(-g, 1.0);
    const Eigen::Vector2d push(g, 0.0);
    const double moment = static_cast<double>(input.moment_nm);
    const double t = static_cast<double>(input.torque_nm);
    x = f * x + t * push;
    p = f * p * f.transpose() + q * q * drift * drift.transpose() + 1e-3 * push * push.transpose();
    const Eigen::RowVector2d h(1.0, g * k);
    const Eigen::Vector2d shared = -1e-3 * g * k * push;
    const double s =
        (h * p * h.transpose())(0) + 2.0 * (h * shared)(0) + 1e-3 * g * g * k * k + 2.5e-3;
    const Eigen::Vector2d gain = (p * h.transpose() + shared) / s;
    x += gain * (static_cast<double>(input.speed_rad_s) - ((h * x)(0) - g * moment));
    p -= s * gain * gain.transpose();
    ASSERT_NEAR(output.load_torque_nm, x(1), 3e-3) << n;
    ASSERT_NEAR(output.speed_rad_s, x(0), 1e-3) << n;
    ASSERT_NEAR(output.variance_nm2, p(1, 1), 1e-3 * p(1, 1) + 1e-5) << n;
  }
}

// Follows a step of 0.4 rated torque that comes within 1 ms; returns t50 in ms.
double lag_ms(const LoadTorqueFilter::Noise& noise, double speed_sigma) {
  std::mt19937 random(13);
  std::normal_distribution<double> normal;
  auto filter = LoadTorqueFilter::make(kSpindle).value();
  Shaft shaft(150.0);
  const double step = 0.4 * kRated;
  double before = 0.0;
  for (int k = 0; k < 3000; ++k) {
    const double begin = k > 2000 ? 2.0 + step : 2.0;
    const double end = k >= 2000 ? 2.0 + step : 2.0;
    const double torque = k > 2000 ? 2.0 + step : 2.0;
    const double speed = shaft.tick(torque, begin, end, false) + speed_sigma * normal(random);
    const auto output = filter.step(input_of(torque, speed, 0.4), noise);
    const double risen = (static_cast<double>(output.load_torque_nm) - 2.0) / step;
    // The true load crosses half a tick after the tick's begin; outputs belong to its end.
    if (k >= 2000 && risen >= 0.5) return k - 2000 + 0.5 - (risen - 0.5) / (risen - before);
    before = risen;
  }
  return 1e9;
}

TEST(LoadTorqueFilter, FollowsAStepWithinTheLagThatTheNoiseAllows) {
  EXPECT_LT(lag_ms(kClean, 3e-5), 1.0);
  const double noisy = lag_ms(kWhite, 0.05);
  EXPECT_GT(noisy, 1.0);
  EXPECT_LT(noisy, 7.0);
}

TEST(LoadTorqueFilter, FindsAConstantLoadWhileTheSpeedRunsUp) {
  for (const LoadTorqueFilter::Noise& noise : {kClean, kCounts}) {
    auto filter = LoadTorqueFilter::make(kSpindle).value();
    Shaft shaft(50.0);
    LoadTorqueFilter::Output output{};
    for (int k = 0; k < 1000; ++k) {
      const double speed = shaft.tick(9.0, 3.0, 3.0, noise.angle_variance > 0.0F);
      output = filter.step(input_of(9.0, speed, static_cast<double>(noise.centre_ratio)), noise);
    }
    EXPECT_NEAR(output.load_torque_nm, 3.0, 0.002);
    EXPECT_NEAR(output.speed_rad_s, shaft.speed(), 0.01);
    EXPECT_LT(output.edge_probability, 0.1);
  }
}

// Where noise is what it was told and no edge comes, the stated variance is too large by what the
// mixture keeps for an edge that may come: 0.3 of it is seen, that is 1.8 in standard deviation.
// Bounded on both sides: less caution must be claimed too.
TEST(LoadTorqueFilter, StatesAnErrorThatIsSomewhatTooLargeInTheSettledState) {
  std::mt19937 random(14);
  std::normal_distribution<double> normal;
  auto filter = LoadTorqueFilter::make(kSpindle).value();
  Shaft shaft(150.0);
  double squares = 0.0;
  double expected = 0.0;
  double load = 5.0;
  for (int k = 0; k < 40'000; ++k) {
    const double next = load + 0.01 * std::sqrt(kTick) * kRated * normal(random);
    const double speed = shaft.tick(5.0, load, next, false) + 0.05 * normal(random);
    load = next;
    const auto output = filter.step(input_of(5.0 + 0.03 * normal(random), speed, 0.4), kWhite);
    if (k < 2000) continue;
    const double error = static_cast<double>(output.load_torque_nm) - load;
    squares += error * error;
    expected += static_cast<double>(output.variance_nm2);
  }
  EXPECT_GT(squares / expected, 0.2);
  EXPECT_LT(squares / expected, 0.45);
}

TEST(LoadTorqueFilter, OnlyPredictsWhileThereIsNoSpeed) {
  auto filter = LoadTorqueFilter::make(kSpindle).value();
  Shaft shaft(150.0);
  LoadTorqueFilter::Output known{};
  for (int k = 0; k < 500; ++k) {
    known = filter.step(input_of(5.0, shaft.tick(5.0, 5.0, 5.0, false), 0.4), kWhite);
  }
  LoadTorqueFilter::Output blind{};
  float last_variance = known.variance_nm2;
  for (int k = 0; k < 50; ++k) {
    auto input = input_of(8.0, 1e30, 0.4);
    input.speed_valid = false;
    blind = filter.step(input, kWhite);
    EXPECT_GE(blind.variance_nm2, last_variance);
    last_variance = blind.variance_nm2;
  }
  EXPECT_NEAR(blind.load_torque_nm, known.load_torque_nm, 0.02);
  // 3 N m more than the load for 50 ms, in 0.03 kg m^2.
  EXPECT_NEAR(blind.speed_rad_s, known.speed_rad_s + 5.0F, 0.05);
  for (int k = 0; k < 500; ++k) {
    blind = filter.step(input_of(5.0, 155.0, 0.4), kWhite);
  }
  EXPECT_NEAR(blind.load_torque_nm, 5.0, 0.1);
}

TEST(LoadTorqueFilter, LooseningMakesItBelieveTheNextTicks) {
  auto filter = LoadTorqueFilter::make(kSpindle).value();
  Shaft shaft(150.0);
  for (int k = 0; k < 500; ++k) {
    static_cast<void>(filter.step(input_of(5.0, shaft.tick(5.0, 5.0, 5.0, false), 0.4), kWhite));
  }
  auto loosened = filter;
  loosened.loosen(2.0F);
  LoadTorqueFilter::Output stiff{};
  LoadTorqueFilter::Output loose{};
  for (int k = 0; k < 6; ++k) {
    const auto input = input_of(5.5, shaft.tick(5.5, 5.5, 5.5, false), 0.4);
    const auto shifted = input_of(5.5, static_cast<double>(input.speed_rad_s) + 0.02 * k, 0.4);
    stiff = filter.step(shifted, kWhite);
    loose = loosened.step(shifted, kWhite);
  }
  EXPECT_GT(loose.variance_nm2, 4.0F * stiff.variance_nm2);
}

TEST(LoadTorqueFilter, RefusesWhatItCannotWorkWith) {
  using Error = LoadTorqueFilter::ConfigError;
  const auto refused = [](auto change) {
    auto config = kSpindle;
    change(config);
    const auto made = LoadTorqueFilter::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.tick_s = 0.0F; }), Error::kPeriod);
  EXPECT_EQ(refused([](auto& c) { c.tick_s = NAN; }), Error::kPeriod);
  EXPECT_EQ(refused([](auto& c) { c.rated_torque_nm = -1.0F; }), Error::kTorque);
  EXPECT_EQ(refused([](auto& c) { c.edge_slope_1_s = 0.0F; }), Error::kSlope);
  EXPECT_EQ(refused([](auto& c) { c.drift_1_sqrt_s = NAN; }), Error::kSlope);
  EXPECT_EQ(refused([](auto&) {}), std::nullopt);
}

TEST(LoadTorqueFilter, SurvivesAMillionRandomTicksAndFindsTheLoadAfterwards) {
  std::mt19937 random(15);
  std::uniform_real_distribution<float> draw(-1.0F, 1.0F);
  auto filter = LoadTorqueFilter::make(kSpindle).value();
  for (int k = 0; k < 1'000'000; ++k) {
    const float torque = 40.0F * draw(random);
    const LoadTorqueFilter::Noise noise{
        .speed_variance = std::pow(10.0F, -6.0F + 4.0F * draw(random)),
        .angle_variance = k % 3 == 0 ? 0.0F : std::abs(draw(random)),
        .torque_variance = std::pow(10.0F, -4.0F + 4.0F * draw(random)),
        .centre_ratio = 0.25F + 0.25F * draw(random)};
    const auto output = filter.step({.torque_nm = torque,
                                     .moment_nm = 0.5F * torque + draw(random),
                                     .speed_rad_s = 400.0F * draw(random),
                                     .duration_s = 1e-3F * (1.5F + draw(random)),
                                     .inertia_kg_m2 = 0.03F,
                                     .speed_valid = k % 5 != 0},
                                    noise);
    ASSERT_LT(std::abs(output.load_torque_nm), 1e6F) << k;
    ASSERT_TRUE(output.variance_nm2 >= 0.0F && output.variance_nm2 < 1e12F) << k;
    ASSERT_TRUE(output.edge_probability > 0.0F && output.edge_probability < 1.0F) << k;
  }
  Shaft shaft(150.0);
  LoadTorqueFilter::Output output{};
  for (int k = 0; k < 3000; ++k) {
    output = filter.step(input_of(5.0, shaft.tick(5.0, 5.0, 5.0, false), 0.4), kWhite);
  }
  EXPECT_NEAR(output.load_torque_nm, 5.0, 0.02);
}

TEST(LoadTorqueFilter, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  std::mt19937 random(16);
  std::normal_distribution<double> normal;
  auto original = LoadTorqueFilter::make(kSpindle).value();
  auto resumed = original;
  const auto allocations = allocation_count();
  for (int k = 0; k < 2000; ++k) {
    resumed.restore(original.state());
    auto input = input_of(5.0 + normal(random), 150.0 + normal(random), 0.4);
    input.speed_valid = k % 9 != 0;
    const auto& noise = k % 2 == 0 ? kWhite : kCounts;
    ASSERT_TRUE(same_bits(original.step(input, noise), resumed.step(input, noise))) << k;
    ASSERT_TRUE(same_bits(original.state(), resumed.state())) << k;
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
