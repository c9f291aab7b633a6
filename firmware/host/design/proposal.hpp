// Proposed gains for each controller, from a plant and a wished settling time, and what the linear
// loop then is like. A one-parameter family for each linear law: calm at one end, fast at the
// other. Proposed is the calmest member that settles in time; where none does, the fastest one that
// keeps the margins: the process gain may double, and the loop stays half a unit off -1.
//
//   pi              K_P = tau / (k (lambda + theta)),  K_I = K_P / min(tau, 4 (lambda + theta))
//   pid             K_P = (tau + theta/2) / (k (lambda + theta/2)), T_I = tau + theta/2,
//                   T_D = tau theta / (2 tau + theta), filter N = 10
//   pole_assignment poles z = e^{-3T/s} and -z/4, in the proportion of P1's case I, or 0: its
//                   case III, integral alone
//   variable_gain   K_open = 3 / s
//   fuzzy           step range; around rest the law is K_P = c G_u/G_de, K_I T = c G_u/G_e, with c
//                   measured on the law itself
//   theta = latency + T/2 + feed and sensor lags: what is not tau
//
// mrac and predictive are not linear; their times follow from the wish directly, and a run of the
// simulated machine shows what comes of it (tuning_run.hpp).
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/host/design/linear_analysis.hpp"
#include "firmware/host/design/step_response.hpp"

namespace cutforce::firmware::host {

// Around the force to hold: latency, feed drive, cut (power law and lag), sensor.
struct LoopPlant {
  double gain_n_pct;  // static, at the reference
  double exponent;
  double lag_s;
  double latency_s;
  double feed_lag_s;
  double sensor_lag_s;
  double reference_n;

  // F = reference (U / this)^exponent, so that the gain is exponent reference / this.
  [[nodiscard]] double override_pct() const { return exponent * reference_n / gain_n_pct; }
  // Force over override there, what a law that learns the gain sees: the slope over the exponent.
  [[nodiscard]] double secant_n_pct() const { return reference_n / override_pct(); }
  [[nodiscard]] DiscretePlant discrete(double period_s) const;
};

struct Wish {
  double settling_s;  // to within 5 %
  double period_s;
};

// A key of [control] and its value, as a machine file has them.
struct Setting {
  std::string key;
  std::string value;
};

struct LinearLoop {
  DiscreteController controller;
  Margins margins;
  double highest_gain_n_pct;  // by Schur and Cohn's test; infinity: none found
  LoopStep step;
};

struct Proposal {
  std::string controller;
  std::string rule;  // how it was found
  std::vector<Setting> settings;
  std::vector<LinearLoop> linear;  // one, or none for a law that is not linear
  std::vector<std::string> warnings;
  bool wish_met;
};

[[nodiscard]] std::span<const std::string_view> tunable_controllers();

// For one of these names. pi and pid bring a second proposal, Ziegler and Nichols'.
[[nodiscard]] std::vector<Proposal> propose(std::string_view controller, const LoopPlant& plant,
                                            const Wish& wish);

// What the plant and the period themselves are up to, whatever the controller.
[[nodiscard]] std::vector<std::string> plant_warnings(const LoopPlant& plant, const Wish& wish);

}  // namespace cutforce::firmware::host
