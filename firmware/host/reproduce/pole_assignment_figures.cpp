// P1: fixed and assigned PI gains on an end mill, Figs. 8 to 12.
#include <algorithm>
#include <cmath>

#include "firmware/host/reproduce/finding.hpp"

namespace cutforce::firmware::host {
namespace {

// The later part of a stretch, where a step's transient is over.
Span settled(const ClosedLoop& run, std::size_t stretch, double ratio) {
  return last_part(stretches(run).at(stretch).span, ratio);
}

std::vector<Finding> fixed_gains(const Runs& runs) {
  const ClosedLoop& run = runs.at("p1_fig08");
  const Span one = settled(run, 0, 0.5);
  const Span two = settled(run, 1, 0.7);
  const Span three = settled(run, 2, 0.7);
  const double spike_n = most_n(run, stretches(run).at(1).span);
  const ClosedLoop& lagged = runs.at("p1_fig08_lag");
  const double toggling_n = deviation_n(lagged, settled(lagged, 2, 0.7));
  return {
      {"At 1 mm the feed saturates at 150 %, 300 mm/min, and the force stays below 800 N.",
       sentence("%.0f %%, %.0f N.", mean_override_pct(run, one), mean_n(run, one)),
       Outcome::kAgrees,
       "",
       {{"P1 Fig. 8: override at 1 mm, %", mean_override_pct(run, one), 150.0, 150.0},
        {"P1 Fig. 8: force at 1 mm, N", mean_n(run, one), 627.0, 693.0}}},
      {"At 2 mm 800 N are held well after a spike.",
       sentence("Mean %.0f N, %.0f to %.0f N; spike %.0f N.", mean_n(run, two), least_n(run, two),
                most_n(run, two), spike_n),
       Outcome::kAgrees,
       "The mean is held; a step of 10 % is 88 N here, and the loop hunts between such codes.",
       {{"P1 Fig. 8: mean force at 2 mm, N", mean_n(run, two), 760.0, 840.0},
        {"P1 Fig. 8: spike at 2 mm, N", spike_n, 1254.0, 1386.0}}},
      {"At 3 mm the control is unstable.",
       sentence("A limit cycle between %.0f and %.0f N, override %.0f to %.0f %%.",
                least_n(run, three), most_n(run, three), lowest_override_pct(run, three),
                highest_override_pct(run, three)),
       Outcome::kAgrees,
       "Only the range of the override bounds it. Without the tick in which the firmware makes "
       "sure "
       "that the cut is over, it would be a cycle of two ticks.",
       {{"P1 Fig. 8: lowest override at 3 mm, %", lowest_override_pct(run, three), 0.0, 0.0},
        {"P1 Fig. 8: highest override at 3 mm, %", highest_override_pct(run, three), 150.0, 150.0},
        {"P1 Fig. 8: highest force at 3 mm, N", most_n(run, three), 1881.0, 2079.0}}},
      {"The feed drive's lag may be left out, T being much longer (6).",
       sentence("With a lag of 20 ms 3 mm toggle by a few codes: standard deviation %.0f N.",
                toggling_n),
       Outcome::kDiffers,
       "A lag of 20 ms raises the critical gain, and with steps of 10 % it bounds the oscillation: "
       "the lag helps this loop.",
       {{"P1 Fig. 8: standard deviation at 3 mm with a lag of 20 ms, N", toggling_n, 30.0, 150.0}}},
  };
}

// Of the override, in the 1.5 s after the tool has entered; the first takes the feed of the air
// back.
int swings_at_entry(const ClosedLoop& run) {
  const double enters_s = stretches(run).at(0).span.from_s;
  return swings(run, {enters_s - 0.1, enters_s + 1.5}, 10.0);
}

std::string held(const ClosedLoop& run) {
  std::string text;
  for (std::size_t k = 0; k < 3; ++k) {
    const Span span = settled(run, k, 0.6);
    text += (k > 0 ? "; " : "") + sentence("%.0f mm %.0f N, sd %.0f N",
                                           1e3 * stretches(run).at(k).depth_m, mean_n(run, span),
                                           deviation_n(run, span));
  }
  return text + ".";
}

std::vector<Check> held_checks(const ClosedLoop& run, const char* figure) {
  std::vector<Check> checks;
  for (std::size_t k = 0; k < 3; ++k) {
    checks.push_back({sentence("%s: mean force at %zu mm, N", figure, k + 2),
                      mean_n(run, settled(run, k, 0.6)), 720.0, 880.0});
  }
  return checks;
}

Finding steps_of_override(const ClosedLoop& coarse, const ClosedLoop& fine, const char* figure) {
  const double coarse_n = deviation_n(coarse, settled(coarse, 2, 0.6));
  const double fine_n = deviation_n(fine, settled(fine, 2, 0.6));
  const double rate = changes_1_s(coarse, settled(coarse, 2, 0.6));
  return {
      "800 N are held within what steps of 10 % allow.",
      sentence("At 4 mm the override never rests: %.1f changes/s, sd %.0f N; with steps of 1 %% "
               "%.1f N.",
               rate, coarse_n, fine_n),
      Outcome::kAgrees,
      "A step of 10 % is 176 N at 4 mm, and integral control hunts between the two codes "
      "around 800 N (704 and 880 N): there is no zero steady error with such steps.",
      {{sentence("%s: deviation at 4 mm, steps of 10 %%, N", figure), coarse_n, 40.0, 100.0},
       {sentence("%s: deviation at 4 mm, steps of 1 %%, N", figure), fine_n, 0.0, 15.0}}};
}

std::vector<Finding> case_one(const Runs& runs) {
  const ClosedLoop& run = runs.at("p1_fig09");
  const ClosedLoop& fine = runs.at("p1_fig09_fine");
  const auto cuts = stretches(run);
  const Span air{0.2, cuts.at(0).span.from_s - 0.1};
  const Span last = cuts.at(2).span;
  const double early_n = mean_n(fine, {last.from_s + 2.0, last.from_s + 3.0});
  return {
      {"In the air the feed is 300 mm/min.",
       sentence("Override %.0f %%.", mean_override_pct(run, air)),
       Outcome::kAgrees,
       "",
       {{"P1 Fig. 9: override in the air, %", mean_override_pct(run, air), 150.0, 150.0}}},
      {"800 N are held at 2, 3 and 4 mm; the force rises only locally where the depth steps.",
       held(run), Outcome::kAgrees,
       sentence("Spikes of %.0f and %.0f N at the steps: no feedback avoids them.",
                most_n(run, cuts.at(1).span), most_n(run, cuts.at(2).span)),
       held_checks(run, "P1 Fig. 9")},
      steps_of_override(run, fine, "P1 Fig. 9"),
      {"At 4 mm the force creeps up at a constant feed as the tool wears.",
       sentence(
           "With 3 %% of wear the override falls instead: %.1f to %.1f %% (steps of 1 %%), the "
           "force stays %.0f to %.0f N.",
           mean_override_pct(fine, {last.from_s + 2.0, last.from_s + 3.0}),
           mean_override_pct(fine, last_part(last, 0.15)), early_n,
           mean_n(fine, last_part(last, 0.15))),
       Outcome::kDiffers,
       "A creeping force at a constant feed is what the step of 10 % leaves uncorrected; integral "
       "control takes the rest out."},
  };
}

std::vector<Finding> case_two(const Runs& runs) {
  const ClosedLoop& run = runs.at("p1_fig10");
  const int one = swings_at_entry(runs.at("p1_fig09_fine"));
  const int two = swings_at_entry(runs.at("p1_fig10_fine"));
  const int three = swings_at_entry(runs.at("p1_fig11_fine"));
  return {
      {"Where the cut begins and the depth steps the force oscillates, unlike in case I, because "
       "of "
       "the pole at -0.6.",
       sentence("Swings of the override by 10 %% or more within 1.5 s of the entry: %d; case I %d, "
                "case III %d (steps of 1 %%).",
                two, one, three),
       Outcome::kAgrees,
       "From swing to swing the pole leaves six tenths. Beyond that, at a step from 2 to 3 mm the "
       "true gain is 1.5 times the estimated one where case II allows 1.282: it is unstable until "
       "the estimate has caught up.",
       {{"P1 Fig. 10: swings after the entry, case II", static_cast<double>(two), 4.0, 7.0},
        {"P1 Fig. 9: swings after the entry, case I", static_cast<double>(one), 1.0, 1.0},
        {"P1 Fig. 11: swings after the entry, case III", static_cast<double>(three), 1.0, 1.0}}},
      {"The force moves by the steps of 10 % more than in case I.", held(run), Outcome::kAgrees,
       "Case II answers a step of the override by a larger one the other way.",
       held_checks(run, "P1 Fig. 10")},
  };
}

std::vector<Finding> case_three(const Runs& runs) {
  const ClosedLoop& run = runs.at("p1_fig11");
  return {
      {"Stable, and 800 N are held well; the law is pure integral control.",
       held(run) + sentence(" Proportional gain %.2f %% of case I's.",
                            100.0 * (0.001 * 0.001) / (0.2 * 0.05)),
       Outcome::kAgrees,
       "The paper says about 0.01 % of cases I and II: that is the ratio to case I; to case II it "
       "is "
       "0.0017 %.",
       held_checks(run, "P1 Fig. 11")},
  };
}

std::vector<Finding> case_four(const Runs& runs) {
  const ClosedLoop& run = runs.at("p1_fig12");
  const auto enters =
      std::ranges::find_if(run.depth_m, [](double depth) { return depth > 2.05e-3; });
  const auto leaves =
      std::ranges::find_if(run.depth_m, [](double depth) { return depth > 3.95e-3; });
  const auto at = [&run](auto found) {
    return run.time_s[static_cast<std::size_t>(found - run.depth_m.begin())];
  };
  const Span ramp{at(enters), at(leaves)};
  return {
      {"On a ramp from 2 to 4 mm 800 N are held well.",
       sentence("Mean %.0f N, sd %.0f N along the ramp.", mean_n(run, ramp),
                deviation_n(run, ramp)),
       Outcome::kAgrees,
       "Along the ramp the loop follows by steps of 10 %, 88 to 176 N each.",
       {{"P1 Fig. 12: mean force along the ramp, N", mean_n(run, ramp), 760.0, 840.0},
        {"P1 Fig. 12: deviation along the ramp, N", deviation_n(run, ramp), 10.0, 80.0}}},
  };
}

}  // namespace

std::vector<PaperFigure> pole_assignment_figures() {
  return {
      {"p1_fig08",
       "P1 Fig. 8",
       "Fixed PI gains on 1, 2 and 3 mm",
       {{"p1_fig08", "no lag, P1 (6)"}, {"p1_fig08_lag", "feed lag 20 ms"}},
       &fixed_gains},
      {"p1_fig09",
       "P1 Fig. 9",
       "Case I, poles 0.2 and -0.05, on 2, 3 and 4 mm",
       {{"p1_fig09", "steps of 10 %"}, {"p1_fig09_fine", "steps of 1 %"}},
       &case_one},
      {"p1_fig10",
       "P1 Fig. 10",
       "Case II, poles 0.1 and -0.6, a more worn tool",
       {{"p1_fig10", "steps of 10 %"},
        {"p1_fig10_fine", "steps of 1 %"},
        {"p1_fig09_fine", "case I, steps of 1 %"},
        {"p1_fig11_fine", "case III, steps of 1 %"}},
       &case_two},
      {"p1_fig11",
       "P1 Fig. 11",
       "Case III, poles 0.001 and -0.001, a fresh tool",
       {{"p1_fig11", "steps of 10 %"}, {"p1_fig11_fine", "steps of 1 %"}},
       &case_three},
      {"p1_fig12",
       "P1 Fig. 12",
       "Case IV, poles 0.001 and -0.001, a ramp from 2 to 4 mm",
       {{"p1_fig12", "steps of 10 %"}},
       &case_four},
  };
}

}  // namespace cutforce::firmware::host
