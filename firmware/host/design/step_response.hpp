// What a linear loop does when it is asked for another force, at its ticks, and what gain it bears.
#pragma once

#include <cstddef>
#include <vector>

#include "firmware/host/design/linear_analysis.hpp"

namespace cutforce::firmware::host {

// Unit step into numerator / denominator; the leading coefficients are aligned, degree of the
// numerator not above the denominator's.
[[nodiscard]] std::vector<double> step_response(const Polynomial& numerator,
                                                const Polynomial& denominator, std::size_t ticks);

struct LoopStep {
  std::vector<double> force;     // 1: the new reference
  std::vector<double> override;  // 1: what the static gain asks for
  double overshoot_ratio;
  double settling_s;  // from then on within 5 %; infinity where it never is
};

// Reference stepped by 1, until `duration_s`.
[[nodiscard]] LoopStep loop_step(const DiscretePlant& plant, const DiscreteController& controller,
                                 double duration_s);

// Largest gain up to which the loop is stable for every smaller one too, by Schur and Cohn's test
// from the present gain on upward; infinity where a thousand times the gain is stable, 0 where the
// loop is not stable as it is.
[[nodiscard]] double highest_gain(const DiscretePlant& plant, const DiscreteController& controller);

}  // namespace cutforce::firmware::host
