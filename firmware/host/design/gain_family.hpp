// The laws' families of gains, from calm to fast; see proposal.hpp for the formulas.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/host/design/proposal.hpp"

namespace cutforce::firmware::host {

// Lags told apart into the one that counts, and what is left of all with the dead time.
struct Reduced {
  double lag_s;
  double dead_time_s;
};
[[nodiscard]] Reduced reduced(const LoopPlant& plant, double period_s);

// Gains as they will be written, and the linear law that these make.
struct Member {
  std::vector<Setting> settings;
  DiscreteController controller;
  bool allowed = true;  // by the law's own rules
};

struct NamedFamily {
  std::string rule;
  std::function<Member(double settling_s)> member;
};

// None for a law that is not linear.
[[nodiscard]] std::vector<NamedFamily> families(std::string_view controller, const LoopPlant& plant,
                                                double period_s);

[[nodiscard]] Member pi_member(double proportional_pct_n, double integral_pct_n_s, double period_s);
[[nodiscard]] Member pid_member(double proportional_pct_n, double integral_s, double derivative_s,
                                double period_s);
// What a law that learns force over override starts from.
[[nodiscard]] Setting usual_gain(const LoopPlant& plant);

}  // namespace cutforce::firmware::host
