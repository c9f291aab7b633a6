// P2's identified end mill, G(s) = 6037.7 / (s^2 + 160.2 s + 438.8), (26), in double, sampled
// exactly: two first-order modes, C/(s + A) - C/(s + B). Feed in, cutting force out; the depth of
// cut scales the output (1.3 is the paper's step from 1.0 to 1.3 mm).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace cutforce::host_tests {

class EndMill {
 public:
  static constexpr double kGain = 6037.7;
  static constexpr double kA1 = 160.2;
  static constexpr double kA0 = 438.8;
  static constexpr double kReference_n = 60.0;

  explicit EndMill(double period_s) {
    const double root = std::sqrt(kA1 * kA1 - 4.0 * kA0);
    const double slow = 0.5 * (kA1 - root);
    const double fast = 0.5 * (kA1 + root);
    pole_hz_[0] = slow;
    pole_hz_[1] = fast;
    for (std::size_t i = 0; i < 2; ++i) {
      decay_[i] = std::exp(-pole_hz_[i] * period_s);
      gain_[i] = (i == 0 ? kGain : -kGain) / root / pole_hz_[i];
    }
  }

  // The force at the end of a period over which the feed was held.
  double step(double feed_mm_s, double depth_ratio) {
    double force_n = 0.0;
    rate_n_s_ = 0.0;
    for (std::size_t i = 0; i < 2; ++i) {
      mode_n_[i] = decay_[i] * mode_n_[i] + (1.0 - decay_[i]) * gain_[i] * feed_mm_s;
      force_n += mode_n_[i];
      rate_n_s_ += pole_hz_[i] * (gain_[i] * feed_mm_s - mode_n_[i]);
    }
    return depth_ratio * force_n;
  }

  // dF/dt at 1 mm, now.
  [[nodiscard]] double rate_n_s() const { return rate_n_s_; }

 private:
  double pole_hz_[2]{};  // [1/s]
  double decay_[2]{};
  double gain_[2]{};
  double mode_n_[2]{};
  double rate_n_s_ = 0.0;
};

// What is asked of a step response, from its first sample on.
struct StepResponse {
  double peak_n;
  double last_n;
  double settled_s;  // after the last sample outside the band around the reference

  StepResponse(const std::vector<double>& force_n, double reference_n, double band_ratio,
               double period_s)
      : peak_n(*std::max_element(force_n.begin(), force_n.end())),
        last_n(force_n.back()),
        settled_s(0.0) {
    for (std::size_t i = 0; i < force_n.size(); ++i) {
      if (std::abs(force_n[i] - reference_n) > band_ratio * reference_n)
        settled_s = static_cast<double>(i + 1) * period_s;
    }
  }
};

}  // namespace cutforce::host_tests
