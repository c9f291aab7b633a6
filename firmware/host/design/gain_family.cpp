#include "firmware/host/design/gain_family.hpp"

#include <algorithm>
#include <cmath>

#include "control/fuzzy.hpp"
#include "control/pid.hpp"
#include "control/pole_assignment.hpp"
#include "firmware/host/design/design_text.hpp"

namespace cutforce::firmware::host {
namespace {

constexpr double kDerivativeFilter = 10.0;

}  // namespace

Reduced reduced(const LoopPlant& plant, double period_s) {
  const double slowest_s = std::max({plant.lag_s, plant.feed_lag_s, plant.sensor_lag_s});
  const double lags_s = plant.lag_s + plant.feed_lag_s + plant.sensor_lag_s;
  return {slowest_s, plant.latency_s + 0.5 * period_s + lags_s - slowest_s};
}

Setting usual_gain(const LoopPlant& plant) {
  return {"process_gain_n_pct", number(rounded(plant.secant_n_pct()))};
}

namespace {

DiscreteController pi_law(double proportional, double integral_tick) {
  return {{proportional + integral_tick, -proportional}, {1.0, -1.0}};
}

}  // namespace

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

namespace {

// Two poles on the plant that settles within a tick, P1 (14).
Member pole_member(double slow, double fast, const LoopPlant& plant) {
  const double z1 = rounded(slow);
  const double z2 = rounded(fast);
  const auto gains = control::assigned_gains(plant.secant_n_pct(), z1 + z2, z1 * z2);
  return {{{"pole_assignment_pole_1_ratio", number(z1)},
           {"pole_assignment_pole_2_ratio", number(z2)},
           usual_gain(plant)},
          pi_law(gains.proportional, gains.integral_tick),
          z1 <= 0.98};
}

// P3 (11): integral alone, over the learned gain. The law itself asks for K_open T < 1/n with n
// periods of dead time; half of that, for the gain may double.
Member variable_gain_member(double open_1_s, const LoopPlant& plant, double period_s) {
  const double periods = std::ceil(rounded(plant.latency_s) / period_s - 1e-6);
  const double highest = periods < 1.0 ? 2.0 : 1.0 / periods;
  return {{{"variable_gain_open_loop_1_s", number(open_1_s)},
           {"override_latency_s", number(rounded(plant.latency_s))},
           usual_gain(plant)},
          pi_law(0.0, open_1_s * period_s / plant.secant_n_pct()),
          open_1_s * period_s <= 0.5 * highest};
}

// Step of the fuzzy law for an error, both in its own ranges, around rest: it is steeper there than
// on the whole.
double fuzzy_slope() {
  constexpr float kSmall = 0.01F;
  auto law = *control::FuzzyPi::make(
      {.period_s = 1.0F, .error_range_n = 1.0F, .change_range_n = 1.0F, .step_range_pct = 1.0F});
  control::LawInput input{.force_reference_n = 1.0F,
                          .force_n = 1.0F - kSmall,
                          .force_sigma_n = 0.0F,
                          .override_applied_pct = 100.0F,
                          .override_tolerance_pct = 0.0F,
                          .spindle_ratio = 1.0F,
                          .phase = control::CutPhase::kCut,
                          .mode = control::LawMode::kTrack,
                          .part_start = false};
  (void)law.step(input);  // the error stays, so that the next step is the integral part alone
  input.mode = control::LawMode::kActive;
  return static_cast<double>((law.step(input).override_pct - 100.0F) / kSmall);
}

Member fuzzy_member(double step_pct, const LoopPlant& plant) {
  const double range_n = rounded(0.5 * plant.reference_n);
  const double slope_pct_n = fuzzy_slope() * step_pct / range_n;
  return {{{"fuzzy_error_range_n", number(range_n)},
           {"fuzzy_change_range_n", number(range_n)},
           {"fuzzy_step_range_pct", number(step_pct)}},
          pi_law(slope_pct_n, slope_pct_n)};
}

}  // namespace

std::vector<NamedFamily> families(std::string_view controller, const LoopPlant& plant,
                                  double period_s) {
  const Reduced r = reduced(plant, period_s);
  const double k = plant.gain_n_pct;
  // From a time to settle to the time constant that it leaves.
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
    return {{"settling time",
             [=](double s) { return variable_gain_member(rounded(3.0 / s), plant, period_s); }}};
  if (controller == "fuzzy")
    return {{"settling time", [=](double s) {
               return fuzzy_member(rounded(1.5 * period_s / s * plant.reference_n / k), plant);
             }}};
  return {};
}

}  // namespace cutforce::firmware::host
