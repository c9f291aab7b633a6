// How well the force was held on one part, from the true force at each step of the simulation.
// A constant gain error of the estimate is taken out first: no controller can see it.
#pragma once

#include <cstdint>
#include <vector>

namespace cutforce::firmware::host {

struct PartMetrics {
  double peak_ratio = 0.0;      // highest force over the reference
  double impulse_ns = 0.0;      // N s above the reference
  double impulse_105_ns = 0.0;  // N s above 105 % of it
  double shortfall_ns = 0.0;    // N s below it, in the cut and below the ceiling
  double above_110_s = 0.0;
  double rms_ratio = 0.0;    // error in the cut and below the ceiling, over the reference
  double mean_ratio = 0.0;   // of the force there, over the reference
  double settling_s = -1.0;  // within 5 % for good after the part's event; below 0: not measured
  double time_s = 0.0;       // to the end of the part
  double changes = 0.0;      // of the override
  bool finished = false;     // the end of the part was reached
};

class PartScore {
 public:
  struct Step {
    double time_s;
    double force_n;  // true, times the gain of the estimate
    double position_m;
    double override_pct;
    bool in_cut;
  };

  struct Config {
    double reference_n;
    double ceiling_pct;
    double step_s;
    double mean_s;         // 0: the force as it is
    double settle_from_m;  // below 0: nowhere
    double settle_to_m;
  };

  explicit PartScore(const Config& config);
  void step(const Step& step);
  void sent(double override_pct);
  [[nodiscard]] PartMetrics metrics(bool finished) const;

 private:
  [[nodiscard]] double judged_n(double force_n);

  Config config_;
  PartMetrics sums_{};
  double last_sent_pct_ = -1.0;
  double square_ = 0.0;
  double held_s_ = 0.0;
  double event_s_ = -1.0;
  double outside_s_ = -1.0;
  std::vector<double> window_;
  std::size_t window_at_ = 0;
  double window_sum_ = 0.0;
};

// Sums over parts; peaks and settling times by their worst.
[[nodiscard]] PartMetrics total(const std::vector<PartMetrics>& metrics);

}  // namespace cutforce::firmware::host
