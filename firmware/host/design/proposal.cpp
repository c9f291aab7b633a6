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

namespace cutforce::firmware::host {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLeastGainRatio = 2.0;
constexpr double kLeastModulus = 0.5;
constexpr double kDerivativeFilter = 10.0;

// Lags told apart into the one that counts and what is left of them all.
struct Reduced {
  double lag_s;
  double dead_time_s;
};
Reduced reduced(const LoopPlant& plant, double period_s) {
  const double slowest_s = std::max({plant.lag_s, plant.feed_lag_s, plant.sensor_lag_s});
  const double lags_s = plant.lag_s + plant.feed_lag_s + plant.sensor_lag_s;
  return {slowest_s, plant.latency_s + 0.5 * period_s + lags_s - slowest_s};  // (C90)
}

// One member of a family: gains as they will be written, and the linear law they make.
struct Member {
  std::vector<Setting> settings;
  DiscreteController controller;
};
using Family = std::function<Member(double settling_s)>;

DiscreteController pi_law(double proportional, double integral_tick) {
  return {{proportional + integral_tick, -proportional}, {1.0, -1.0}};
}

Member pi_member(double proportional, double integral, double period_s) {
  const double kp = rounded(proportional);
  const double ki = rounded(integral);
  return {{{"pi_proportional_pct_n", number(kp)}, {"pi_integral_pct_n_s", number(ki)}},
          pi_law(kp, ki * period_s)};
}

Member pid_member(double proportional, double integral_s, double derivative_s, double period_s) {
  const control::Pid::Config config{
      .period_s = static_cast<float>(period_s),
      .proportional_pct_n = static_cast<float>(rounded(proportional)),
      .integral_time_s = static_cast<float>(rounded(integral_s)),
      .derivative_time_s = static_cast<float>(rounded(derivative_s)),
      .derivative_filter_ratio = static_cast<float>(kDerivativeFilter)};
  return {{{"pid_proportional_pct_n", number(rounded(proportional))},
           {"pid_integral_time_s", number(rounded(integral_s))},
           {"pid_derivative_time_s", number(rounded(derivative_s))},
           {"pid_derivative_filter_ratio", number(kDerivativeFilter)}},
          controller_of(config)};
}

// z^2 - sum z + product on the plant that settles within a tick, P1 (14).
Member pole_member(double slow, double fast, const LoopPlant& plant) {
  const double sum = rounded(slow + fast);
  const double product = rounded(slow * fast);
  const double k = plant.gain_n_pct;
  return {{{"pole_assignment_sum", number(sum)}, {"pole_assignment_product", number(product)}},
          pi_law(-product / k, (1.0 - sum + product) / k)};
}

std::vector<std::pair<std::string, Family>> families(std::string_view controller,
                                                     const LoopPlant& plant, double period_s) {
  const Reduced r = reduced(plant, period_s);
  const double k = plant.gain_n_pct;
  // From a time to settle to the time constant that it leaves, (C91).
  const auto lambda = [r](double s) { return std::max(s - r.dead_time_s, 1e-6) / 3.0; };
  if (controller == "pi")
    return {{"settling time", [=](double s) {
               const double slowness_s = lambda(s) + r.dead_time_s;
               const double kp = r.lag_s / (k * slowness_s);
               const double ti = std::min(r.lag_s, 4.0 * slowness_s);
               // Without a lag the law is an integral alone.
               return pi_member(kp, r.lag_s > 0.0 ? kp / ti : 1.0 / (k * slowness_s), period_s);
             }}};
  if (controller == "pid")
    return {{"settling time", [=](double s) {
               const double half_s = 0.5 * r.dead_time_s;
               const double ti = r.lag_s + half_s;
               return pid_member(ti / (k * (lambda(s) + half_s)), ti, r.lag_s * half_s / ti,
                                 period_s);
             }}};
  const auto pole = [=](double s) { return std::exp(-3.0 * period_s / s); };
  if (controller == "pole_assignment")
    return {{"settling time, two poles as 1 to -1/4",
             [=](double s) { return pole_member(pole(s), -0.25 * pole(s), plant); }},
            {"settling time, integral alone",
             [=](double s) { return pole_member(pole(s), 0.0, plant); }}};
  if (controller == "variable_gain")
    return {{"settling time", [=](double s) {
               const double open_1_s = rounded(3.0 / s);
               return Member{{{"variable_gain_open_loop_1_s", number(open_1_s)}},
                             pi_law(0.0, open_1_s * period_s / k)};
             }}};
  if (controller == "fuzzy")
    return {{"settling time", [=](double s) {
               const double error_n = rounded(0.5 * plant.reference_n);
               const double output_pct = rounded(3.0 * period_s / s * error_n / k);
               return Member{{{"fuzzy_error_n", number(error_n)},
                              {"fuzzy_error_change_n", number(error_n)},
                              {"fuzzy_output_pct", number(output_pct)}},
                             pi_law(output_pct / error_n, output_pct / error_n)};
             }}};
  return {};
}

LinearLoop analysed(const DiscretePlant& plant, DiscreteController controller, double duration_s) {
  LinearLoop loop{
      .controller = std::move(controller), .margins = {}, .highest_gain_n_pct = 0.0, .step = {}};
  loop.margins = margins(plant, loop.controller);
  loop.step = loop_step(plant, loop.controller, duration_s);
  loop.highest_gain_n_pct = highest_gain(plant, loop.controller);
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
std::optional<Proposal> best_of(std::string_view controller, const std::string& rule,
                                const Family& family, const LoopPlant& plant, const Wish& wish) {
  const DiscretePlant discrete = plant.discrete(wish.period_s);
  const Reduced r = reduced(plant, wish.period_s);
  const double duration_s = std::max(4.0 * wish.settling_s, 30.0 * (r.lag_s + r.dead_time_s));
  std::optional<Proposal> fastest;
  constexpr int kMembers = 120;
  const double calmest_s = 10.0 * std::max(wish.settling_s, r.lag_s + r.dead_time_s);
  const double briskest_s = 0.5 * wish.period_s;
  for (int i = 0; i < kMembers; ++i) {
    const double s = calmest_s * std::pow(briskest_s / calmest_s, i / (kMembers - 1.0));
    Member member = family(s);
    LinearLoop loop = analysed(discrete, member.controller, duration_s);
    if (!keeps_margins(loop)) continue;
    const double settles_s = loop.step.settling_s;
    if (fastest && !(settles_s < fastest->linear[0].step.settling_s)) continue;
    fastest = proposal_of(controller, rule, std::move(member), std::move(loop));
    if (settles_s <= wish.settling_s) return fastest;
  }
  if (!fastest) return {};
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
  // At rest the gradient acts as an integral of 2/3 of its rate.
  const double rate_1_s = rounded(std::min(0.5 / (r.dead_time_s + r.lag_s), 1.0 / wish.period_s));
  auto proposal = time_based(
      "mrac", {{"mrac_model_time_s", number(model_s)}, {"mrac_adaptation_hz", number(rate_1_s)}});
  if (wish.settling_s < least_s) too_fast(proposal, wish, r, least_s);
  return proposal;
}

Proposal predictive(const LoopPlant& plant, const Wish& wish) {
  const double horizon_s = std::max(wish.settling_s / 1.5, 2.0 * wish.period_s);
  auto proposal =
      time_based("predictive", {{"predictive_calm_horizon_s", number(rounded(horizon_s))},
                                {"predictive_latency_s", number(rounded(plant.latency_s))},
                                {"predictive_feed_lag_s", number(rounded(plant.feed_lag_s))},
                                {"predictive_process_lag_s", number(rounded(plant.lag_s))},
                                {"predictive_sensor_lag_s", number(rounded(plant.sensor_lag_s))},
                                {"predictive_exponent", number(rounded(plant.exponent))}});
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
  for (const auto& [rule, family] : families(controller, plant, wish.period_s)) {
    if (auto found = best_of(controller, rule, family, plant, wish))
      proposals.push_back(std::move(*found));
  }
  if (controller == "pi" || controller == "pid") {
    if (auto found = ziegler_nichols(controller, plant, wish))
      proposals.push_back(std::move(*found));
    else if (!proposals.empty())
      proposals.front().warnings.push_back(
          "Ziegler and Nichols' rule is left out: the loop would not be stable");
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
