// P1: fixed and assigned PI gains on an end mill, Figs. 8 to 12.
#include "firmware/host/reproduce/finding.hpp"

namespace cutforce::firmware::host {
namespace {

std::vector<Finding> fixed_gains(const Runs& runs) {
  const ClosedLoop& run = runs.at("p1_fig08");
  const auto cuts = stretches(run);
  const Span one = last_part(cuts.at(0).span, 0.5);
  const Span two = last_part(cuts.at(1).span, 0.7);
  const Span three = last_part(cuts.at(2).span, 0.7);
  const ClosedLoop& lagged = runs.at("p1_fig08_lag");
  const Span lagged_three = last_part(stretches(lagged).at(2).span, 0.7);
  return {
      {"At 1 mm the feed saturates at 150 %, 300 mm/min, and the force stays below 800 N.",
       sentence("%.0f %%, %.0f N.", mean_override_pct(run, one), mean_n(run, one)),
       true,
       "",
       {{"P1 Fig. 8: override at 1 mm, %", mean_override_pct(run, one), 150.0, 150.0},
        {"P1 Fig. 8: force at 1 mm, N", mean_n(run, one), 627.0, 693.0}}},
      {"At 2 mm 800 N are held well after a spike.",
       sentence("Mean %.0f N, %.0f to %.0f N; spike %.0f N.", mean_n(run, two), least_n(run, two),
                most_n(run, two), most_n(run, cuts.at(1).span)),
       true,
       "The mean is held; the step of 10 % is 88 N here, between whose codes the loop hunts.",
       {{"P1 Fig. 8: mean force at 2 mm, N", mean_n(run, two), 760.0, 840.0},
        {"P1 Fig. 8: spike at 2 mm, N", most_n(run, cuts.at(1).span), 1254.0, 1386.0}}},
      {"At 3 mm the control is unstable.",
       sentence("A limit cycle between %.0f and %.0f N, override %.0f to %.0f %%.",
                least_n(run, three), most_n(run, three), lowest_override_pct(run, three),
                highest_override_pct(run, three)),
       true,
       "Only the range of the override bounds it.",
       {{"P1 Fig. 8: lowest override at 3 mm, %", lowest_override_pct(run, three), 0.0, 0.0},
        {"P1 Fig. 8: highest override at 3 mm, %", highest_override_pct(run, three), 150.0, 150.0},
        {"P1 Fig. 8: highest force at 3 mm, N", most_n(run, three), 1881.0, 2079.0}}},
      {"The feed drive's lag may be left out, T being much longer (6).",
       sentence("With a lag of 20 ms 3 mm toggle by a few codes: standard deviation %.0f N.",
                deviation_n(lagged, lagged_three)),
       false,
       "A lag of 20 ms raises the critical gain from 5.71 to 5.79, and with steps of 10 % it "
       "bounds the oscillation: the lag helps this loop.",
       {{"P1 Fig. 8: standard deviation at 3 mm with a lag of 20 ms, N",
         deviation_n(lagged, lagged_three), 30.0, 150.0}}},
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
  };
}

}  // namespace cutforce::firmware::host
