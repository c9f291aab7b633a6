#include "firmware/host/design/tuning.hpp"

#include <cmath>
#include <utility>

#include "firmware/host/design/design_text.hpp"

namespace cutforce::firmware::host {
namespace {

std::vector<std::string> identification_warnings(const Identification& found,
                                                 const LoopPlant& plant) {
  std::vector<std::string> warnings;
  const auto& p = found.plant;
  const double away = plant.reference_n / p.force_n;
  if (!(away > 0.5 && away < 2.0))
    warnings.push_back("the step test was made at " + brief(p.force_n) + " N, far from the " +
                       brief(plant.reference_n) +
                       " N to hold: repeat it nearer, or give --reference");
  if (p.slow_residual > 0.3)
    warnings.push_back(
        "the force also drifts by itself (wear, depth or material): the gain is a mean, and its "
        "uncertainty may be larger than stated");
  if (p.lag_s.sigma > 0.5 * p.lag_s.value)
    warnings.push_back("the lag is not known well, only the sum of dead time and lag is");
  if (!found.bank) {
    warnings.push_back(
        "no second opinion on the dead time: the force never moved by 4 % within a tick");
  } else if (std::abs(found.bank->best_s - p.dead_time_s.value) >
             0.04 + 2.0 * p.dead_time_s.sigma) {
    warnings.push_back("the latency bank finds a dead time of " + brief(found.bank->best_s) +
                       " s, least squares " + brief(p.dead_time_s.value) +
                       " s: repeat the step test with larger steps");
  }
  return warnings;
}

// A loop must bear what is not known of the plant: two standard deviations of it.
void mind_uncertainty(Proposal& proposal, const IdentifiedPlant& plant) {
  if (proposal.linear.empty()) return;
  const auto& margins = proposal.linear.front().margins;
  const double gain = 1.0 + 2.0 * plant.gain_n_pct.sigma / plant.gain_n_pct.value;
  if (margins.gain_ratio < gain)
    proposal.warnings.push_back("the gain margin does not cover the gain's own uncertainty");
  if (margins.delay_s < 2.0 * plant.dead_time_s.sigma)
    proposal.warnings.push_back("the delay margin does not cover the dead time's own uncertainty");
}

// Where no linear loop says so before, the run says whether the wish is met.
void mind_simulation(TriedProposal& tried, const Wish& wish) {
  const double settles_s = tried.runs[1].approach.settling_s;
  if (!(tried.settles_up_to >= 1.0)) {
    tried.proposal.warnings.push_back("in simulation it does not come to rest");
    tried.proposal.wish_met = false;
  } else if (tried.proposal.linear.empty() && settles_s > wish.settling_s) {
    if (tried.proposal.wish_met)
      tried.proposal.warnings.push_back("settling within " + brief(wish.settling_s) +
                                        " s is not reached: in simulation it takes " +
                                        brief(settles_s) + " s");
    tried.proposal.wish_met = false;
  }
}

TriedProposal tried(Proposal proposal, const LoopPlant& plant, const Wish& wish) {
  TriedProposal out{.proposal = std::move(proposal), .runs = {}, .settles_up_to = 0.0};
  const auto machine = tuned_machine(out.proposal, plant, wish);
  if (!machine) {
    out.proposal.warnings.push_back("not simulated: a machine file would refuse these values");
    return out;
  }
  for (const double ratio : {0.5, 1.0, 2.0})
    out.runs.push_back(tuning_run(*machine, plant, wish, ratio));
  out.settles_up_to = settles_up_to(*machine, plant, wish);
  mind_simulation(out, wish);
  return out;
}

}  // namespace

LoopPlant plant_at(const IdentifiedPlant& plant, double reference_n) {
  const double p = plant.exponent.value;
  const double working_pct = plant.override_pct * std::pow(reference_n / plant.force_n, 1.0 / p);
  return {.gain_n_pct = p * reference_n / working_pct,
          .exponent = p,
          .lag_s = plant.lag_s.value,
          .latency_s = plant.dead_time_s.value,
          .feed_lag_s = plant.known_lags_s[0],
          .sensor_lag_s = plant.known_lags_s[1],
          .reference_n = reference_n};
}

Tuning tune(const LoopPlant& plant, const Wish& wish, std::optional<Identification> identification,
            const std::vector<std::string_view>& controllers) {
  Tuning tuning{.plant = plant,
                .wish = wish,
                .identification = std::move(identification),
                .proposals = {},
                .warnings = plant_warnings(plant, wish)};
  if (tuning.identification) {
    for (auto& warning : identification_warnings(*tuning.identification, plant))
      tuning.warnings.push_back(std::move(warning));
  }
  for (const auto controller : controllers) {
    for (auto& proposal : propose(controller, plant, wish)) {
      if (tuning.identification) mind_uncertainty(proposal, tuning.identification->plant);
      tuning.proposals.push_back(tried(std::move(proposal), plant, wish));
    }
  }
  return tuning;
}

}  // namespace cutforce::firmware::host
