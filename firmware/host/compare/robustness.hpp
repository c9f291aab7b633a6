// How far a machine may be from the one that a controller was set for before the loop swings and
// does not stop. Noise-free, on the comparison's lathe in a long cut of one depth, where the gain
// of the process jumps once, 2 s after the start.
//
// Sustained oscillation: in the last 6 s of 20 s the force spreads by more than 5 % of the
// reference (standard deviation) and crosses its own mean at least four times. A force that rests
// off the reference, or moves by one code to and fro below that, does not count. The override may
// go down to 5 %, because 16 times the gain needs 5 %.
#pragma once

#include <vector>

#include "firmware/host/compare/contender.hpp"

namespace cutforce::firmware::host {

struct Swing {
  double spread_ratio = 0.0;  // standard deviation of the force over the reference
  int crossings = 0;          // of its mean
  [[nodiscard]] bool sustained() const { return spread_ratio > 0.05 && crossings >= 4; }
};

// Of a force, sampled evenly.
[[nodiscard]] Swing swing_of(const std::vector<double>& force_n, double reference_n);

struct LongCut {
  double gain_before = 1.0;  // over the gain of 1 mm, at which the reference needs 129 %
  double gain_after = 1.0;
  double latency_s = 0.025;
};
[[nodiscard]] Swing swing_in(const Contender& contender, const LongCut& cut, const Trial& trial);

// The last of a row of harder and harder cuts up to which the loop comes to rest; below the first
// where it does not in any.
struct Robustness {
  double gain_up_ratio = 1.0;    // jump of the gain from 1 mm to this many times that: up to 16
  double gain_down_ratio = 1.0;  // from this many times to 1 mm
  double latency_s = -1.0;       // at a jump by half, from 0 to 0.6; below 0: at none
};
[[nodiscard]] Robustness robustness_of(const Contender& contender, const Trial& trial);

}  // namespace cutforce::firmware::host
