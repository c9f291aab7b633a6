// The filter beside Kalman filters in matrices and double precision.
#include "estimator/load_torque_filter.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "support/spindle_shaft.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::LoadTorqueFilter;

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

}  // namespace
}  // namespace cutforce::host_tests
