// The estimator chain as a controller sees it, without the motor: the true force behind a lag or a
// mean over whole turns, with a gain error and noise that is correlated in time. Equations (S40),
// (S41).
#pragma once

#include <cstdint>
#include <vector>

#include "hal/host/simulation/random.hpp"

namespace cutforce::hal::host {

struct ForceSensorConfig {
  double lag_s = 0.0;        // first order
  double mean_s = 0.0;       // mean over this window instead, where it is above 0
  double dead_time_s = 0.0;  // before either
  double gain_ratio = 1.0;
  double noise_ratio = 0.0;  // standard deviation, of the force
  double noise_n = 0.0;      // standard deviation, beside it
  double noise_correlation_s = 0.0;
};

class ForceSensor {
 public:
  ForceSensor(const ForceSensorConfig& config, double step_s, double sample_s, std::uint64_t seed);

  // The force over one step of the simulation.
  void step(double force_n) noexcept;
  // What is read now; draws the noise of one sample.
  [[nodiscard]] double read() noexcept;
  // As if the force had been this for long.
  void settle(double force_n) noexcept;
  // Without noise: what read() would show.
  [[nodiscard]] double clean_n() const noexcept { return gain_ratio_ * value_n_; }

 private:
  double gain_ratio_;
  double noise_ratio_;
  double noise_n_;
  double lag_share_;
  double memory_;      // of the noise, from one sample to the next
  double innovation_;  // sqrt(1 - memory^2)
  std::vector<double> late_n_;
  std::vector<double> window_n_;
  std::size_t late_at_ = 0;
  std::size_t window_at_ = 0;
  double sum_n_ = 0.0;
  double value_n_ = 0.0;
  RandomStream relative_;
  RandomStream absolute_;
  double relative_noise_ = 0.0;
  double absolute_noise_ = 0.0;
};

}  // namespace cutforce::hal::host
