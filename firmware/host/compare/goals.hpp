// What the predictive law is to reach, each mark with the figure that it is held against. A mark
// appears where the comparison holds what it needs; what needs cuts of its own cuts them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "firmware/host/compare/comparison.hpp"

namespace cutforce::firmware::host {

struct Goal {
  int number;  // of the list of goals that the project set itself
  std::string text;
  double value;
  double limit;
  bool at_most = true;  // else at least
  [[nodiscard]] bool reached() const { return at_most ? value <= limit : value >= limit; }
};

// From the figures of the comparison alone.
[[nodiscard]] std::vector<Goal> goals_of(const Comparison& comparison, std::string_view subject);

// With cuts of their own: parts that nobody tuned to, long cuts, a mean over whole turns, other
// misalignments.
[[nodiscard]] std::vector<Goal> further_goals(const Contender& subject, unsigned threads,
                                              const WorkProgress& progress);

// Time of these parts at one override each, safe at the part's deepest place.
[[nodiscard]] double constant_feed_time_s(const std::vector<Part>& parts, const Trial& trial);

}  // namespace cutforce::firmware::host
