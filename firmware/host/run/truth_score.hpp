// How well a run of the simulated machine went, against what was true: the estimate, and the force
// that the controller held. Streaming where figures allow it; the series that do not are kept at
// the estimate's rate.
#pragma once

#include <vector>

#include "firmware/host/evaluation/metrics.hpp"
#include "firmware/host/run/figure.hpp"
#include "firmware/loop_output.hpp"
#include "firmware/machine.hpp"
#include "hal/host/simulation/simulated_machine.hpp"

namespace cutforce::firmware::host {

class TruthScore {
 public:
  // The truth of the very sample with which the output came.
  void add(const LoopOutput& output, const hal::host::MachineTruth& truth);

  // The estimate against the truth: lag, error at rest, noise, coverage.
  [[nodiscard]] std::vector<Figure> estimate_figures(const Machine& machine) const;
  // The force held in each stretch of constant depth of cut: settling, mean, spread, peak.
  [[nodiscard]] std::vector<Figure> force_figures(const Machine& machine) const;
  // Where the depth of cut jumps.
  [[nodiscard]] std::vector<Event> events() const;

 private:
  struct Row {
    double time_s;
    double depth_m;
    double true_force_n;
    double true_torque_nm;
    double torque_nm;  // NaN: no estimate
    double sigma_nm;
    double override_pct;
  };
  struct Stretch {
    std::size_t begin;
    std::size_t end;
    double depth_m;
  };
  [[nodiscard]] std::vector<Stretch> stretches() const;
  void add_stretch(const Stretch& stretch, double reference_n, std::vector<Figure>& out) const;
  [[nodiscard]] double lag_s() const;

  std::vector<Row> rows_;
};

}  // namespace cutforce::firmware::host
