// Terminal signals of an induction motor in quasi-steady state, with whatever an inverter and its
// sensors may do to them. Made for tests of signal checks: currents follow the load at once.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

namespace cutforce::host_tests {

enum class VoltageSampling { kAveraged, kRawPwm };

struct MotorCondition {
  double sample_rate_hz = 5000.0;
  double speed_rpm = 1500.0;  // synchronous, two pole pairs; negative: backward
  double run_up_s = 0.0;
  double load = 0.0;      // 1: rated torque
  double noise = 0.005;   // of rated peak, rms per channel
  bool quantised = true;  // 12 bit over +-800 V and +-28.28 A
  double offset = 0.0;    // of rated peak
  double gain_error = 0.0;
  VoltageSampling voltage = VoltageSampling::kAveraged;
  double carrier_hz = 4000.0;
  double carrier_phase = 0.0;  // of the sampling in the carrier, 0..1
};

class MotorSignals {
 public:
  static constexpr double kFlux = 0.94;
  static constexpr double kDcLink = 540.0;
  static constexpr double kResistance = 3.7;

  struct Sample {
    std::array<double, 3> v;
    std::array<double, 3> i;
    double frequency_rad_s;
  };

  explicit MotorSignals(const MotorCondition& at) : condition(at) {}

  MotorCondition condition;  // may be changed between samples

  // The true signals of the next sample, before condition.noise and converter.
  Sample next() {
    const double t = static_cast<double>(n_++) / condition.sample_rate_hz;
    const double rated = condition.speed_rpm / 60.0 * 2.0 * 2.0 * std::numbers::pi;
    const double w =
        condition.run_up_s > 0.0 ? rated * std::min(t / condition.run_up_s, 1.0) : rated;
    theta_ += w / condition.sample_rate_hz;
    const double active = 7.0 * condition.load + 0.3;
    const double peak_v = std::min(std::fabs(w) * kFlux + kResistance * active + 5.0, 311.0);
    const double magnetising = 3.3;
    const double peak_i = std::hypot(active, magnetising);
    const double lag = std::copysign(std::atan2(magnetising, active), rated);
    Sample s{{}, {}, w};
    for (std::size_t k = 0; k < 3; ++k) {
      const double shift = 2.0 * std::numbers::pi / 3.0 * static_cast<double>(k);
      s.v[k] = peak_v * std::cos(theta_ - shift);
      s.i[k] = peak_i * std::cos(theta_ - lag - shift);
    }
    if (condition.voltage == VoltageSampling::kRawPwm) switch_inverter(s, t);
    return s;
  }

  // As the converter reads it.
  double read(double value, bool is_voltage) {
    std::normal_distribution<double> normal;
    const double rated = is_voltage ? 326.0 : 7.07;
    const double range = is_voltage ? 800.0 : 28.28;
    double x = value * (1.0 + condition.gain_error) +
               rated * (condition.offset + condition.noise * normal(random_));
    if (condition.quantised) {
      const double step = range / 2048.0;
      x = step * std::clamp(std::round(x / step), -2048.0, 2047.0);
    }
    return x;
  }

  std::mt19937& random() { return random_; }

 private:
  // Space-vector modulation (sine with the mean of its extremes), symmetric triangle.
  void switch_inverter(Sample& s, double t) const {
    const auto [least, most] = std::minmax({s.v[0], s.v[1], s.v[2]});
    const double place = t * condition.carrier_hz + condition.carrier_phase;
    const double triangle = 4.0 * std::fabs(place - std::floor(place) - 0.5) - 1.0;
    std::array<double, 3> leg{};
    for (std::size_t k = 0; k < 3; ++k)
      leg[k] = s.v[k] - 0.5 * (least + most) > 0.5 * kDcLink * triangle ? kDcLink : 0.0;
    const double mean = (leg[0] + leg[1] + leg[2]) / 3.0;
    for (std::size_t k = 0; k < 3; ++k) s.v[k] = leg[k] - mean;
  }

  std::uint64_t n_ = 0;
  double theta_ = 0.3;
  std::mt19937 random_{1};
};

}  // namespace cutforce::host_tests
