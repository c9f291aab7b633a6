// P2: PID and model reference adaptive control of an end mill, Figs. 9 to 12.
#include <algorithm>
#include <cmath>

#include "firmware/host/reproduce/finding.hpp"

namespace cutforce::firmware::host {
namespace {

Span whole(const ClosedLoop& run) { return {run.time_s.front(), run.time_s.back()}; }

double peak_ratio(const ClosedLoop& run, const Span& span) {
  return most_n(run, span) / run.reference_n;
}

// Mean size of the force error in the cut, as a part of the reference.
double mean_error_ratio(const ClosedLoop& run) {
  double sum = 0.0;
  double count = 0.0;
  for (std::size_t k = 0; k < run.time_s.size(); ++k) {
    if (run.depth_m[k] < 0.9e-3 || run.time_s[k] > run.finished_s) continue;
    sum += std::abs(run.force_n[k] - run.reference_n);
    count += 1.0;
  }
  return sum / count / run.reference_n;
}

// From 0.5 s after the tool is in full depth to 0.5 s before the step, and so on: at rest.
Span at_rest(const ClosedLoop& run, std::size_t stretch) {
  return last_part(stretches(run).at(stretch).span, 0.5);
}

std::vector<Finding> simulated(const Runs& runs) {
  const ClosedLoop& pid = runs.at("p2_fig09_pid");
  const ClosedLoop& fast = runs.at("p2_fig09_pid_1ms");
  const ClosedLoop& pi = runs.at("p2_fig09_pi");
  const ClosedLoop& mrac = runs.at("p2_fig09_mrac");
  const Span all = whole(pid);
  const Span later{2.0, all.to_s};
  const double slams = changes_1_s(pid, later);
  const double mrac_s = settling_s(mrac, whole(mrac), 0.05);
  const double pi_s = settling_s(pi, whole(pi), 0.02);
  const double fast_s = settling_s(fast, whole(fast), 0.02);
  return {
      {"PID (K_P = 25, T_I = 0.03 s, T_D = 0.005 s) at 20 ms: little overshoot, settles in 1.7 s.",
       sentence("Unstable: the command goes between %.0f and %.0f %%, %.0f changes/s. The force "
                "swings between %.1f and %.1f N, mean %.1f N; within 5 %%: %s.",
                lowest_override_pct(pid, later), highest_override_pct(pid, later), slams,
                least_n(pid, later), most_n(pid, later), mean_n(pid, later),
                seconds_or_never(settling_s(pid, all, 0.05)).c_str()),
       Outcome::kDiffers,
       "The largest pole of this loop is 23. Only the clamp of the feed bounds it, and only the "
       "slow pole of 2.8 1/s hides it in the force; a feed drive would not stand it.",
       {{"P2 Fig. 9: changes a second of the printed PID's command", slams, 30.0, 50.0},
        {"P2 Fig. 9: its lowest override, %", lowest_override_pct(pid, later), 0.0, 5.0},
        {"P2 Fig. 9: its highest override, %", highest_override_pct(pid, later), 195.0, 200.0}}},
      {"The printed PID gains in a loop of 1 ms, as the ultimate gain and period (27) suggest.",
       sentence("Overshoot %.1f %%, 2 %% after %s, override at rest %.0f to %.0f %%.",
                100.0 * (peak_ratio(fast, whole(fast)) - 1.0), seconds_or_never(fast_s).c_str(),
                lowest_override_pct(fast, {4.0, 6.0}), highest_override_pct(fast, {4.0, 6.0})),
       Outcome::kBeside,
       "Stable and quick where there is no noise. The paper's 1.7 s is near what the plant alone "
       "needs at a constant feed, 1.65 s to 1 %.",
       {{"P2 Fig. 9: overshoot of the printed PID at 1 ms, %",
         100.0 * (peak_ratio(fast, whole(fast)) - 1.0), -1.0, 2.0},
        {"P2 Fig. 9: its 2 % settling, s", fast_s, 0.1, 0.8}}},
      {"A PI law designed for the plant at 20 ms.",
       sentence("K_P = 0.12 (mm/s)/N, T_I = 0.36 s: overshoot %.1f %%, 2 %% after %s.",
                100.0 * (peak_ratio(pi, whole(pi)) - 1.0), seconds_or_never(pi_s).c_str()),
       Outcome::kBeside,
       "T_I cancels the pole at 2.8 1/s.",
       {{"P2 Fig. 9: overshoot of the redesigned PI, %", 100.0 * (peak_ratio(pi, whole(pi)) - 1.0),
         -1.0, 1.0},
        {"P2 Fig. 9: its 2 % settling, s", pi_s, 0.7, 1.0}}},
      {"MRAC (mu = 18) follows its model, settles in about 1.7 s, no overshoot.",
       sentence("5 %% after %s, peak %.3f of the reference, with the state scaled by 6.6.",
                seconds_or_never(mrac_s).c_str(), peak_ratio(mrac, whole(mrac))),
       Outcome::kAgrees,
       "mu means nothing without the scale of the state, which the paper does not give: with 1 the "
       "force is 4 N after 4 s, from 10 on the loop diverges.",
       {{"P2 Fig. 9: 5 % settling of the MRAC, s", mrac_s, 1.6, 1.8},
        {"P2 Fig. 9: peak of the MRAC over the reference", peak_ratio(mrac, whole(mrac)), 0.95,
         1.01}}},
  };
}

std::vector<Finding> pid_cut(const Runs& runs) {
  const ClosedLoop& run = runs.at("p2_fig10");
  const auto cuts = stretches(run);
  const Span rest = at_rest(run, 0);
  const double slams = changes_1_s(run, rest);
  const ClosedLoop& fast = runs.at("p2_fig10_1ms");
  const Span fast_rest = at_rest(fast, 0);
  return {
      {"Overshoot where the cut begins; deviations that stay in parts of the cut.",
       sentence("Peak %.2f of the reference after the entry, %.2f at the step; at rest %.1f N, sd "
                "%.1f N.",
                peak_ratio(run, cuts.at(0).span), peak_ratio(run, cuts.at(1).span),
                mean_n(run, rest), deviation_n(run, rest)),
       Outcome::kAgrees,
       sentence("The command changes %.0f times a second between its clamps. What looks like a "
                "deviation that stays is the mean of that, below 60 N: the clamps are not the same "
                "distance away.",
                slams),
       {{"P2 Fig. 10: changes a second of the printed PID's command", slams, 30.0, 50.0},
        {"P2 Fig. 10: mean force at rest, N", mean_n(run, rest), 57.0, 61.0},
        {"P2 Fig. 10: deviation of the force, N", deviation_n(run, rest), 0.5, 6.0}}},
      {"The printed PID gains in a loop of 1 ms, with noise of 1 % and 0.3 N.",
       sentence("At rest %.1f N, sd %.1f N; the command between %.0f and %.0f %%, %.0f changes/s.",
                mean_n(fast, fast_rest), deviation_n(fast, fast_rest),
                lowest_override_pct(fast, fast_rest), highest_override_pct(fast, fast_rest),
                changes_1_s(fast, fast_rest)),
       Outcome::kBeside,
       "Stable as it is, this loop only works without noise: its derivative takes a noise of 1 N "
       "from clamp to clamp.",
       {{"P2 Fig. 10: mean force of the printed PID at 1 ms with noise, N", mean_n(fast, fast_rest),
         40.0, 80.0}}},
  };
}

std::vector<Finding> mrac_cut(const Runs& runs) {
  const ClosedLoop& run = runs.at("p2_fig11");
  const auto cuts = stretches(run);
  const double before = mean_n(run, at_rest(run, 0));
  const double peak = most_n(run, cuts.at(1).span);
  const double after = mean_n(run, at_rest(run, 2));
  return {
      {"The force converges to 60 N and follows the model to the end.",
       sentence("%.1f N at 1 mm, %.1f N at 1 mm again; %.1f N where the depth steps to 1.3 mm.",
                before, after, peak),
       Outcome::kAgrees,
       "The jump itself is the cut's: 78 N at the feed of 1 mm.",
       {{"P2 Fig. 11: force at 1 mm, N", before, 57.0, 63.0},
        {"P2 Fig. 11: peak at the step, N", peak, 72.0, 81.0},
        {"P2 Fig. 11: force at 1 mm again, N", after, 57.0, 63.0}}},
  };
}

std::vector<Finding> compared(const Runs& runs) {
  const ClosedLoop& none = runs.at("p2_fig12_uncontrolled");
  const ClosedLoop& pid = runs.at("p2_fig10");
  const ClosedLoop& mrac = runs.at("p2_fig11");
  const ClosedLoop& pi = runs.at("p2_fig12_pi");
  const double pid_error = 100.0 * mean_error_ratio(pid);
  const double mrac_error = 100.0 * mean_error_ratio(mrac);
  const double pi_error = 100.0 * mean_error_ratio(pi);
  return {
      {"Uncontrolled the step from 1 to 1.3 mm takes the force from 60 to 78 N.",
       sentence("%.1f N at 1 mm, %.1f N at 1.3 mm.", mean_n(none, at_rest(none, 0)),
                mean_n(none, at_rest(none, 1))),
       Outcome::kAgrees,
       "",
       {{"P2 Fig. 12: uncontrolled force at 1.3 mm, N", mean_n(none, at_rest(none, 1)), 76.0,
         80.0}}},
      {"MRAC holds the force better than PID.",
       sentence("Mean error in the cut: printed PID %.1f %%, MRAC %.1f %%, redesigned PI %.1f %%.",
                pid_error, mrac_error, pi_error),
       agrees_if(mrac_error < pid_error),
       "Whatever the printed PID does: a correctly designed PI is better than both. The comparison "
       "is with a PID that is unstable at the paper's own sampling time.",
       {{"P2 Fig. 12: mean error of the redesigned PI over that of the MRAC", pi_error / mrac_error,
         0.0, 0.9}}},
      {"Cutting time: uncontrolled, then MRAC, then PID.",
       sentence("%.2f, %.2f, %.2f s; redesigned PI %.2f s.", none.finished_s, mrac.finished_s,
                pid.finished_s, pi.finished_s),
       agrees_if(none.finished_s < mrac.finished_s && mrac.finished_s < pid.finished_s),
       "The differences follow from how far below 60 N each law stays.",
       {}},
  };
}

}  // namespace

std::vector<PaperFigure> end_mill_figures() {
  return {
      {"p2_fig09",
       "P2 Fig. 9",
       "The papers' simulation: PID and MRAC from rest to 60 N",
       {{"p2_fig09_pid", "PID as printed, 20 ms"},
        {"p2_fig09_pid_1ms", "PID as printed, 1 ms"},
        {"p2_fig09_pi", "PI, redesigned, 20 ms"},
        {"p2_fig09_mrac", "MRAC"}},
       &simulated},
      {"p2_fig10",
       "P2 Fig. 10",
       "PID on the stepped work piece",
       {{"p2_fig10", "PID as printed, 20 ms"}, {"p2_fig10_1ms", "PID as printed, 1 ms"}},
       &pid_cut},
      {"p2_fig11",
       "P2 Fig. 11",
       "MRAC on the stepped work piece",
       {{"p2_fig11", "MRAC"}},
       &mrac_cut},
      {"p2_fig12",
       "P2 Fig. 12",
       "Uncontrolled, PID and MRAC compared",
       {{"p2_fig10", "PID as printed"},
        {"p2_fig11", "MRAC"},
        {"p2_fig12_uncontrolled", "uncontrolled"},
        {"p2_fig12_pi", "PI, redesigned"}},
       &compared},
  };
}

}  // namespace cutforce::firmware::host
