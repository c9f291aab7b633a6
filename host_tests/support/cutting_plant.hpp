// The simplest machine that a control law can be closed around: feed override in, cutting force
// out, once a control tick, in double, with no random part. Equation (C15): control/EQUATIONS.md.
//
//   q(i) = c a(i) (U(i - latency) / 100)^p       force at rest for the override, [N]
//   F(i+1) = alpha F(i) + (1 - alpha) q(i),      alpha = exp(-T / tau)
//
// c: force at depth 1 mm and 100 % override; a: depth, [mm]; p: exponent on feed, 1 is linear;
// tau = 0: the cut settles within the tick. latency 1 is "ZOH + 1 sample" of the literature.
#pragma once

#include <cmath>
#include <cstddef>
#include <deque>

namespace cutforce::host_tests {

class CuttingPlant {
 public:
  struct Config {
    double period_s;
    double time_constant_s;
    double force_n;        // c
    double feed_exponent;  // p
    std::size_t latency_ticks;
    double override_pct;  // before the first tick
  };

  explicit CuttingPlant(const Config& config)
      : config_(config),
        alpha_(config.time_constant_s > 0.0 ? std::exp(-config.period_s / config.time_constant_s)
                                            : 0.0),
        sent_pct_(config.latency_ticks, config.override_pct) {}

  // The force at the end of a tick over which `override_pct` was sent and the depth was depth_mm.
  double step(double override_pct, double depth_mm) {
    sent_pct_.push_back(override_pct);
    const double feed_ratio = sent_pct_.front() / 100.0;
    sent_pct_.pop_front();
    // Linear feed may be negative: linear analysis works around zero.
    const double power =
        config_.feed_exponent == 1.0 ? feed_ratio : std::pow(feed_ratio, config_.feed_exponent);
    force_n_ = alpha_ * force_n_ + (1.0 - alpha_) * config_.force_n * depth_mm * power;
    return force_n_;
  }

  [[nodiscard]] double force_n() const { return force_n_; }
  [[nodiscard]] double alpha() const { return alpha_; }
  void set_force(double force_n) { force_n_ = force_n; }

 private:
  Config config_;
  double alpha_;
  std::deque<double> sent_pct_;
  double force_n_ = 0.0;
};

}  // namespace cutforce::host_tests
