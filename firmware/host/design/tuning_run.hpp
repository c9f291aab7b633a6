// A proposal on the simulated machine: the firmware's own loop with the proposed keys, the power
// law, limits, slew and rounding included. It starts in the cut at 80 % of the override that the
// force needs; once settled, the cut becomes half as deep again.
#pragma once

#include <optional>
#include <vector>

#include "firmware/host/design/proposal.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware::host {

struct StepFigures {
  double overshoot_ratio;  // above the reference
  double settling_s;       // from then on within 5 %, or what rounding leaves; infinity: never
};

struct TuningRun {
  double gain_ratio;  // of this run's plant over the one designed for
  std::vector<double> time_s;
  std::vector<double> force_n;
  std::vector<double> override_pct;
  double deeper_s;       // when the cut becomes deeper
  double rest_pct;       // override that the force needs before that
  StepFigures approach;  // from 80 % of the override
  StepFigures deeper;    // half as deep again
};

// The default machine with a dynamometer, the wish's period and the proposal's keys. Nothing where
// this version of the firmware has no such controller, or refuses a value.
[[nodiscard]] std::optional<Machine> tuned_machine(const Proposal& proposal, const LoopPlant& plant,
                                                   const Wish& wish);

// Override limits of these runs: as wide as the byte goes, it is the gains that are tried.
inline constexpr double kRunFloorPct = 5.0;
inline constexpr double kRunCeilingPct = 254.0;

[[nodiscard]] TuningRun tuning_run(const Machine& machine, const LoopPlant& plant, const Wish& wish,
                                   double gain_ratio);

// Largest of 1, 1.5, 2, 3 ... 8 times the gain, up to which every run settles after both steps; 0
// where not even the first does.
[[nodiscard]] double settles_up_to(const Machine& machine, const LoopPlant& plant,
                                   const Wish& wish);

}  // namespace cutforce::firmware::host
