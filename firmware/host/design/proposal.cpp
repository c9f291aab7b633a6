#include "firmware/host/design/proposal.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

#include "control/pid.hpp"
#include "firmware/host/design/design_text.hpp"
#include "firmware/host/design/gain_family.hpp"

namespace cutforce::firmware::host {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLeastGainRatio = 2.0;
constexpr double kLeastModulus = 0.5;

LinearLoop analysed(const DiscretePlant& plant, DiscreteController controller, double duration_s) {
  LinearLoop loop{
      .controller = std::move(controller), .margins = {}, .highest_gain_n_pct = 0.0, .step = {}};
  loop.margins = margins(plant, loop.controller);
  loop.step = loop_step(plant, loop.controller, duration_s);
  return loop;
}

bool keeps_margins(const LinearLoop& loop) {
  return loop.margins.stable && loop.margins.gain_ratio >= kLeastGainRatio &&
         loop.margins.modulus_ratio >= kLeastModulus;
}

Proposal proposal_of(std::string_view controller, std::string rule, Member member,
                     LinearLoop loop) {
  return {.controller = std::string(controller),
          .rule = std::move(rule),
          .settings = std::move(member.settings),
          .linear = {std::move(loop)},
          .warnings = {},
          .wish_met = true};
}

void too_fast(Proposal& proposal, const Wish& wish, const Reduced& r, double had_s) {
  proposal.wish_met = false;
  proposal.warnings.push_back("settling within " + brief(wish.settling_s) +
                              " s cannot be had with " + proposal.controller + " behind " +
                              brief(r.dead_time_s) +
                              " s of dead time and small lags; proposed is "
                              "what can be had, about " +
                              brief(had_s) + " s");
}

// The calmest member in time, else the fastest that keeps the margins.
std::optional<Proposal> best_of(std::string_view controller, const NamedFamily& family,
                                const LoopPlant& plant, const Wish& wish) {
  const DiscretePlant discrete = plant.discrete(wish.period_s);
  const Reduced r = reduced(plant, wish.period_s);
  const double duration_s = std::max(4.0 * wish.settling_s, 30.0 * (r.lag_s + r.dead_time_s));
  std::optional<Proposal> fastest;
  constexpr int kMembers = 120;
  const double calmest_s = 10.0 * std::max(wish.settling_s, r.lag_s + r.dead_time_s);
  const double briskest_s = 0.5 * wish.period_s;
  for (int i = 0; i < kMembers; ++i) {
    const double s = calmest_s * std::pow(briskest_s / calmest_s, i / (kMembers - 1.0));
    Member member = family.member(s);
    if (!member.allowed) continue;
    LinearLoop loop = analysed(discrete, member.controller, duration_s);
    if (!keeps_margins(loop)) continue;
    const double settles_s = loop.step.settling_s;
    if (fastest && !(settles_s < fastest->linear[0].step.settling_s)) continue;
    fastest = proposal_of(controller, family.rule, std::move(member), std::move(loop));
    if (settles_s <= wish.settling_s) break;
  }
  if (!fastest || fastest->linear[0].step.settling_s <= wish.settling_s) return fastest;
  too_fast(*fastest, wish, r, fastest->linear[0].step.settling_s);
  return fastest;
}

std::optional<Proposal> ziegler_nichols(std::string_view controller, const LoopPlant& plant,
                                        const Wish& wish) {
  const DiscretePlant discrete = plant.discrete(wish.period_s);
  const auto limit = ultimate(discrete);
  if (!(limit.gain < kInfinity)) return {};
  const auto gain = static_cast<float>(limit.gain);
  const auto period = static_cast<float>(limit.period_s);
  const bool pid = controller == "pid";
  const auto rule =
      pid ? control::ziegler_nichols_pid(gain, period) : control::ziegler_nichols_pi(gain, period);
  const auto kp = static_cast<double>(rule.proportional_pct_n);
  const auto ti = static_cast<double>(rule.integral_time_s);
  Member member =
      pid ? pid_member(kp, ti, static_cast<double>(rule.derivative_time_s), wish.period_s)
          : pi_member(kp, kp / ti, wish.period_s);
  const double duration_s = std::max(4.0 * wish.settling_s, 20.0 * limit.period_s);
  auto loop = analysed(discrete, member.controller, duration_s);
  if (!loop.margins.stable) return {};  // the rule knows neither the period nor the filter
  auto proposal =
      proposal_of(controller, "Ziegler and Nichols", std::move(member), std::move(loop));
  if (!keeps_margins(proposal.linear[0]))
    proposal.warnings.push_back("Ziegler and Nichols' rule leaves little margin here: " +
                                margin_text(proposal.linear[0].margins));
  proposal.wish_met = proposal.linear[0].step.settling_s <= wish.settling_s;
  return proposal;
}

Proposal time_based(std::string_view controller, std::vector<Setting> settings) {
  return {.controller = std::string(controller),
          .rule = "settling time",
          .settings = std::move(settings),
          .linear = {},
          .warnings = {},
          .wish_met = true};
}

Proposal mrac(const LoopPlant& plant, const Wish& wish) {
  const Reduced r = reduced(plant, wish.period_s);
  // A model faster than the cut itself asks the law for gains that its bounds refuse.
  const double least_s = r.dead_time_s + 1.5 * r.lag_s;
  const double model_s = rounded((std::max(wish.settling_s, least_s) - r.dead_time_s) / 3.0);
  // Found by runs with dead times of 0.03 to 0.33 s and lags of 0.03 to 0.3 s: the fastest that
  // overshoots by less than 4 % with a model of 0.3 s.
  const double slowness_s = r.dead_time_s + 0.5 * r.lag_s;
  const double rate_1_s = rounded(std::min(0.8 / slowness_s, 0.5 / wish.period_s));
  auto proposal = time_based("mrac", {{"mrac_model_time_s", number(model_s)},
                                      {"mrac_adaptation_hz", number(rate_1_s)},
                                      usual_gain(plant)});
  if (wish.settling_s < least_s) too_fast(proposal, wish, r, least_s);
  return proposal;
}

Proposal predictive(const LoopPlant& plant, const Wish& wish) {
  const double horizon_s = std::max(wish.settling_s / 1.5, 2.0 * wish.period_s);
  // The model's lags must not be nil; a millisecond is none to a control period.
  const auto lag = [](double lag_s) { return number(rounded(std::max(lag_s, 0.001))); };
  const double at_100_n =
      plant.reference_n * std::pow(100.0 / plant.override_pct(), plant.exponent);
  auto proposal =
      time_based("predictive", {{"predictive_calm_horizon_s", number(rounded(horizon_s))},
                                {"process_gain_n_pct", number(rounded(at_100_n / 100.0))},
                                {"feed_exponent_ratio", number(rounded(plant.exponent))},
                                {"override_latency_s", number(rounded(plant.latency_s))},
                                {"feed_lag_s", lag(plant.feed_lag_s)},
                                {"process_lag_s", lag(plant.lag_s)},
                                {"force_lag_s", number(rounded(plant.sensor_lag_s))}});
  const double least_s = plant.latency_s + 3.0 * wish.period_s;
  if (wish.settling_s < least_s) too_fast(proposal, wish, reduced(plant, wish.period_s), least_s);
  return proposal;
}

constexpr std::array<std::string_view, 7> kTunable{
    "pi", "pid", "pole_assignment", "variable_gain", "fuzzy", "mrac", "predictive"};

}  // namespace

DiscretePlant LoopPlant::discrete(double period_s) const {
  return discretise(lags(gain_n_pct, {lag_s, feed_lag_s, sensor_lag_s}), period_s, latency_s);
}

std::span<const std::string_view> tunable_controllers() { return kTunable; }

std::vector<Proposal> propose(std::string_view controller, const LoopPlant& plant,
                              const Wish& wish) {
  if (controller == "mrac") return {mrac(plant, wish)};
  if (controller == "predictive") return {predictive(plant, wish)};
  std::vector<Proposal> proposals;
  for (const auto& family : families(controller, plant, wish.period_s)) {
    if (auto found = best_of(controller, family, plant, wish))
      proposals.push_back(std::move(*found));
  }
  if (controller == "pi" || controller == "pid") {
    if (auto found = ziegler_nichols(controller, plant, wish))
      proposals.push_back(std::move(*found));
    else if (!proposals.empty())
      proposals.front().warnings.push_back(
          "Ziegler and Nichols' rule is left out: the loop would not be stable");
  }
  const DiscretePlant discrete = plant.discrete(wish.period_s);
  for (auto& proposal : proposals) {
    for (auto& loop : proposal.linear)
      loop.highest_gain_n_pct = highest_gain(discrete, loop.controller);
  }
  return proposals;
}

std::vector<std::string> plant_warnings(const LoopPlant& plant, const Wish& wish) {
  std::vector<std::string> warnings;
  const double seen_after_s = plant.latency_s + plant.sensor_lag_s + plant.feed_lag_s + plant.lag_s;
  if (wish.period_s > seen_after_s)
    warnings.push_back("a control period of " + brief(wish.period_s) +
                       " s is longer than dead time and lags together (" + brief(seen_after_s) +
                       " s): a shorter one would see a step sooner");
  const double working_pct = plant.override_pct();
  if (working_pct < 20.0 || working_pct > 200.0)
    warnings.push_back(brief(plant.reference_n) + " N needs an override of " + brief(working_pct) +
                       " %, which is outside 20..200 %: program another feed");
  return warnings;
}

}  // namespace cutforce::firmware::host
