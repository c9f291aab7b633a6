// A second opinion on the dead time: eleven candidates run side by side, and the one whose force
// moves when the measured one moves is right. Works on relative changes, so that it needs no gain.
//
//   s_i: answer of unit gain with dead time L_i
//   J_i = mean of (d ln F - d ln s_i)^2, over the ticks in which some |d ln s_i| > 4 %
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "firmware/host/design/identify.hpp"

namespace cutforce::firmware::host {

inline constexpr std::size_t kCandidateCount = 11;

struct LatencyOpinion {
  std::array<double, kCandidateCount> latency_s;
  std::array<double, kCandidateCount> cost;  // J_i, relative to the smallest
  double best_s;  // between candidates by the parabola through the lowest three
  std::size_t ticks;
};

// Candidates lie `spacing_s` apart from 0 on; changes are taken over period_s or a row, whichever
// is longer. Nothing where fewer than ten ticks moved by 4 %.
[[nodiscard]] std::optional<LatencyOpinion> latency_bank(const StepTest& test,
                                                         const IdentifiedPlant& plant,
                                                         double period_s, double spacing_s);

}  // namespace cutforce::firmware::host
