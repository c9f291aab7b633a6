// The papers' equations, evaluated: P1 (8), (14); P2 (18), (26), (27), (33)-(35).
#include <array>
#include <cmath>
#include <utility>

#include "control/mrac_state_error.hpp"
#include "control/pid.hpp"
#include "control/pole_assignment.hpp"
#include "firmware/host/design/linear_analysis.hpp"
#include "firmware/host/reproduce/finding.hpp"

namespace cutforce::firmware::host {
namespace {

// Of one turn, P1's sampling time.
constexpr double kTurn_s = 0.1;

struct Poles {
  double first;
  double second;
};
constexpr std::array<Poles, 3> kCases{{{0.2, -0.05}, {0.1, -0.6}, {0.001, -0.001}}};

Check near(std::string name, double value, double wanted, double tolerance) {
  return {std::move(name), value, wanted - tolerance, wanted + tolerance};
}

// z^2 + (k Kp + k Ki T - 1) z - k Kp, P1 (7).
Polynomial characteristic(double gain, double proportional, double integral_tick) {
  return {1.0, gain * (proportional + integral_tick) - 1.0, -gain * proportional};
}

// Where Schur and Cohn find the fixed gains' loop to leave the unit circle.
double critical_gain() {
  double stable = 1.0;
  double unstable = 20.0;
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (stable + unstable);
    (is_stable(characteristic(middle, 0.05, 2.5 * kTurn_s)) ? stable : unstable) = middle;
  }
  return stable;
}

// With a feed drive that lags by `lag_s`, P1 (5).
double critical_gain(double lag_s) {
  const control::PiController::Config law{.period_s = static_cast<float>(kTurn_s),
                                          .form = control::PiController::Form::kVelocity,
                                          .proportional_pct_n = 0.05F,
                                          .integral_pct_n_s = 2.5F,
                                          .tracking_s = static_cast<float>(kTurn_s),
                                          .supervise = false};
  return margins(discretise(lags(1.0, {lag_s}), kTurn_s, 0.0), controller_of(law)).gain_ratio;
}

Finding fixed_gains() {
  const double gain = critical_gain();
  const double lagged = critical_gain(0.02);
  return {
      "With K_p = 0.05 and K_i = 2.5 the poles leave the unit circle somewhere between 2 and "
      "3 mm (4.1).",
      sentence("Critical process gain %.4f N/(mm/min); at 2.2 N/(mm/min) a mm that is %.2f mm. "
               "With a feed lag of 20 ms %.2f.",
               gain, gain / 2.2, lagged),
      Outcome::kAgrees,
      "P1 prints neither K_m nor K_c; with 2.2 N/(mm/min) a mm its three statements on Fig. 8 "
      "all hold.",
      {near("P1: critical gain of the fixed-gain loop, N/(mm/min)", gain, 5.7143, 1e-3),
       near("P1: the same with a feed lag of 20 ms", lagged, 5.79, 0.01)}};
}

// P1 (14) and back through (8).
double worst_round_trip() {
  double worst = 0.0;
  for (const Poles& poles : kCases) {
    for (const double gain : {0.3, 2.2, 8.8}) {
      const auto gains =
          control::assigned_gains(gain, poles.first + poles.second, poles.first * poles.second);
      const Polynomial back = characteristic(gain, gains.proportional, gains.integral_tick);
      const double root = std::sqrt(back[1] * back[1] - 4.0 * back[2]);
      worst = std::max({worst, std::abs(0.5 * (-back[1] + root) - poles.first),
                        std::abs(0.5 * (-back[1] - root) - poles.second)});
    }
  }
  return worst;
}

// The true gain over the estimated one at which the assigned loop is unstable.
double allowed_ratio(const Poles& poles) {
  const auto gains =
      control::assigned_gains(1.0, poles.first + poles.second, poles.first * poles.second);
  return 2.0 / (2.0 * gains.proportional + gains.integral_tick);
}

Finding assigned_poles() {
  const double first = allowed_ratio(kCases[0]);
  const double second = allowed_ratio(kCases[1]);
  const double third = allowed_ratio(kCases[2]);
  return {
      "(14) puts the poles where they are wanted; case II oscillates after a step because of "
      "its pole at -0.6 (4.2).",
      sentence("Back through (8) to %.0e. The true gain may be %.3f (I), %.3f (II), %.3f (III) "
               "times the estimated one.",
               worst_round_trip(), first, second, third),
      Outcome::kAgrees,
      "A step from 2 to 3 mm is a ratio of 1.5: case II is unstable until the estimate has "
      "caught up. That is the quantitative cause of the oscillation in Fig. 10.",
      {{"P1: poles through (14) and (8), worst error", worst_round_trip(), 0.0, 1e-9},
       near("P1: allowed gain ratio, case I", first, 2.326, 1e-3),
       near("P1: allowed gain ratio, case II", second, 1.282, 1e-3),
       near("P1: allowed gain ratio, case III", third, 2.0, 1e-3)}};
}

ContinuousPlant end_mill() { return second_order(6037.7, 160.2, 438.8); }

Finding sampled_plant() {
  const auto plant = discretise(end_mill(), 0.02, 0.0);
  const auto at = [](const Polynomial& p, std::size_t from_end) {
    return p[p.size() - 1 - from_end];
  };
  return {"(18) samples the identified plant (26).",
          sentence("alpha = %.6f, %.7f; beta = %.6f, %.6f.", at(plant.denominator, 1),
                   at(plant.denominator, 0), at(plant.numerator, 1), at(plant.numerator, 0)),
          Outcome::kAgrees,
          "With C = b/sqrt(a1^2 - 4 a0); the product that is printed is a slip.",
          {near("P2: alpha_1 of the sampled plant", at(plant.denominator, 1), -0.988701, 1e-6),
           near("P2: alpha_0", at(plant.denominator, 0), 0.0405995, 1e-6),
           near("P2: beta_1", at(plant.numerator, 1), 0.522168, 1e-6),
           near("P2: beta_0", at(plant.numerator, 0), 0.191929, 1e-6)}};
}

// The canonical form of a1, a0 by zero-order hold: the model's own formula has the same shape.
Finding state_model() {
  const double root = std::sqrt(160.2 * 160.2 - 4.0 * 438.8);
  const auto plant = control::reference_model(static_cast<float>(0.5 * (160.2 - root)),
                                              static_cast<float>(0.5 * (160.2 + root)), 0.02F);
  const auto model = control::reference_model(5.0F, 10.0F, 0.02F);
  const auto number = [](float value) { return static_cast<double>(value); };
  return {
      "(34) is the plant, (35) the reference model; A_m(2,2) = 0.9999.",
      sentence("Plant [[%.4f, %.4f], [%.4f, %.4f]]; A_m(2,2) = %.4f.", number(plant.transition[0]),
               number(plant.transition[1]), number(plant.transition[2]),
               number(plant.transition[3]), number(model.transition[3])),
      Outcome::kDiffers,
      "(34) agrees with (26). (35) is 1/(s^2 + 15 s + 50), whose A_m(2,2) is 0.9909; with the "
      "printed 0.9999 the model would hold 70.6 N, not 60 N.",
      {near("P2: plant (34), A(1,1)", number(plant.transition[0]), 0.0267, 1e-4),
       near("P2: plant (34), A(1,2)", number(plant.transition[1]), -2.5621, 1e-4),
       near("P2: plant (34), A(2,1)", number(plant.transition[2]), 0.0058, 1e-4),
       near("P2: plant (34), A(2,2)", number(plant.transition[3]), 0.9621, 1e-4),
       near("P2: model (35), A_m(2,2)", number(model.transition[3]), 0.9909, 1e-4)}};
}

Finding lyapunov() {
  const auto p =
      control::stein_of_identity(control::reference_model(5.0F, 10.0F, 0.02F).transition);
  return {"P solves P A_m + A_m^T P = -Q (33), with the discrete A_m.",
          sentence("A_m^T P A_m - P = -I gives P = [[%.4f, %.4f], [%.4f, %.4f]].",
                   static_cast<double>(p.p11), static_cast<double>(p.p12),
                   static_cast<double>(p.p12), static_cast<double>(p.p22)),
          Outcome::kDiffers,
          "(33) is the equation of a continuous model. With a discrete A_m its solution is "
          "negative definite, and the law pushes the wrong way.",
          {near("P2: P(1,1) of the discrete equation", static_cast<double>(p.p11), 2.24978, 1e-3),
           near("P2: P(1,2)", static_cast<double>(p.p12), 0.58091, 1e-3),
           near("P2: P(2,2)", static_cast<double>(p.p22), 92.99754, 0.02)}};
}

double spectral_radius_of(double period_s) {
  // Percent of 436 mm/s keep the law's numbers small; the loop's poles do not depend on it.
  constexpr double kFeed = 436.0;
  const control::Pid::Config law{.period_s = static_cast<float>(period_s),
                                 .proportional_pct_n = static_cast<float>(25.0 / kFeed),
                                 .integral_time_s = 3.0e-2F,
                                 .derivative_time_s = 5.0e-3F,
                                 .derivative_filter_ratio = 1e6F};
  const auto plant = discretise(second_order(6037.7 * kFeed, 160.2, 438.8), period_s, 0.0);
  return spectral_radius(closed_loop(plant, controller_of(law)));
}

Finding printed_pid() {
  const auto at = ultimate(discretise(end_mill(), 0.02, 0.0));
  const double slow = spectral_radius_of(0.02);
  const double fast = spectral_radius_of(0.001);
  return {
      "Ultimate gain 52.94, period 0.02398 s (27); K_P = 25, T_I = 0.03 s, T_D = 0.005 s at "
      "T_s = 0.02 s.",
      sentence("Ultimate gain %.3f, period %.4f s. Largest pole %.1f at 20 ms, %.3f at 1 ms.",
               at.gain, at.period_s, slow, fast),
      Outcome::kDiffers,
      "(27) belongs to no sampling of (26) at 20 ms; it is what a simulation at 1 ms finds, "
      "with the period taken twice too long. At 20 ms the printed PID is unstable.",
      {near("P2: ultimate gain at 20 ms", at.gain, 4.999, 1e-3),
       {"P2: largest pole of the printed PID at 20 ms (unstable)", slow, 1.0, 100.0},
       {"P2: largest pole of the printed PID at 1 ms (stable)", fast, 0.0, 0.999}}};
}

}  // namespace

std::vector<Finding> equation_findings() {
  return {fixed_gains(), assigned_poles(), sampled_plant(),
          state_model(), lyapunov(),       printed_pid()};
}

}  // namespace cutforce::firmware::host
