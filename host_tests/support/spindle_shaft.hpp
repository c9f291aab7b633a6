// A shaft for the load torque filter: its parameters, noise of three kinds of speed sensors, and
// the speeds that it would see.
#pragma once

#include "estimator/load_torque_filter.hpp"

namespace cutforce::host_tests {

inline constexpr double kRated = 14.6;
inline constexpr double kInertia = 0.03;
inline constexpr double kTick = 1e-3;

inline constexpr estimator::LoadTorqueFilter::Config kSpindle{
    .tick_s = 1e-3F, .rated_torque_nm = 14.6F, .edge_slope_1_s = 12.0F, .drift_1_sqrt_s = 0.01F};
static_assert(kSpindle.check());

// Five samples a tick, speed noise white or of an angle.
inline constexpr estimator::LoadTorqueFilter::Noise kWhite{.speed_variance = 2.5e-3F,
                                                           .angle_variance = 0.0F,
                                                           .torque_variance = 1e-3F,
                                                           .centre_ratio = 0.4F};
inline constexpr estimator::LoadTorqueFilter::Noise kCounts{.speed_variance = 1e-9F,
                                                            .angle_variance = 0.2F,
                                                            .torque_variance = 1e-3F,
                                                            .centre_ratio = 0.5F};
inline constexpr estimator::LoadTorqueFilter::Noise kClean{.speed_variance = 1e-9F,
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

[[nodiscard]] inline estimator::LoadTorqueFilter::Input input_of(double torque, double speed,
                                                                 double centre) {
  return {.torque_nm = static_cast<float>(torque),
          .moment_nm = static_cast<float>(centre * torque),
          .speed_rad_s = static_cast<float>(speed),
          .duration_s = 1e-3F,
          .inertia_kg_m2 = 0.03F,
          .speed_valid = true};
}

}  // namespace cutforce::host_tests
