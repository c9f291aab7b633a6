// P3: turning force control on a measured and on an estimated force, Figs. 5 to 8.
#include <cmath>

#include "firmware/host/reproduce/finding.hpp"

namespace cutforce::firmware::host {
namespace {

// How a run meets the step from 1 to 1.5 mm, and how it holds the force at rest.
struct Held {
  double overshoot_pct;
  double settling_s;
  double worst_error_pct;  // mean at rest, of both depths
  double deviation_pct;    // at rest, the larger

  explicit Held(const ClosedLoop& run) {
    const auto cuts = stretches(run);
    const Span step = cuts.at(1).span;
    overshoot_pct = 100.0 * (most_n(run, step) / run.reference_n - 1.0);
    settling_s = host::settling_s(run, step, 0.05);
    worst_error_pct = deviation_pct = 0.0;
    for (std::size_t k = 0; k < 2; ++k) {
      const Span rest = last_part(cuts.at(k).span, 0.4);
      const double error_pct = 100.0 * std::abs(mean_n(run, rest) / run.reference_n - 1.0);
      worst_error_pct = std::max(worst_error_pct, error_pct);
      deviation_pct = std::max(deviation_pct, 100.0 * deviation_n(run, rest) / run.reference_n);
    }
  }
};

std::string held_text(const char* name, const Held& held) {
  return sentence("%s: overshoot %.0f %%, within 5 %% after %s, mean error %.1f %%, sd %.1f %%.",
                  name, held.overshoot_pct, seconds_or_never(held.settling_s).c_str(),
                  held.worst_error_pct, held.deviation_pct);
}

Finding measured(const ClosedLoop& run, const char* figure) {
  const Held held(run);
  return {
      "500 N are regulated on the measured force, also where the depth steps to 1.5 mm.",
      held_text("Dynamometer", held),
      Outcome::kAgrees,
      "The paper prints no gains; these are the largest at which the loop on the estimated force "
      "settles too.",
      {{sentence("%s: mean error at rest, %%", figure), held.worst_error_pct, 0.0, 3.0},
       {sentence("%s: overshoot at the step, %%", figure), held.overshoot_pct, 15.0, 45.0},
       {sentence("%s: settling after the step, s", figure), held.settling_s, 0.2, 1.5}}};
}

struct Names {
  const char* figure;
  const char* measured;
  const char* fast;
  const char* synthesized;
  const char* fused;
  const char* lagged;
};

// The paper's statement, judged by what it says: more overshoot and longer settling, both slightly.
Finding nearly_as_good(const Names& names, const Held& dynamometer, const Held& synthesized,
                       const Held& fast) {
  const bool longer = synthesized.settling_s > dynamometer.settling_s;
  return {
      "On the estimated force the loop does nearly as well: slightly more overshoot, slightly "
      "longer settling.",
      held_text("Dynamometer", dynamometer) + " " + held_text("Synthesized", synthesized),
      agrees_if(longer && synthesized.overshoot_pct > dynamometer.overshoot_pct),
      (longer ? std::string()
              : sentence("The overshoot is slightly larger, but the settling is shorter, by "
                         "%.2f s. ",
                         dynamometer.settling_s - synthesized.settling_s)) +
          held_text("The monitor summed up as a lag of 30 ms and 2 % of noise", fast),
      {{sentence("%s: mean error at rest, %%", names.figure), synthesized.worst_error_pct, 0.0,
        3.0},
       {sentence("%s: overshoot beyond the dynamometer's, %%", names.figure),
        synthesized.overshoot_pct - dynamometer.overshoot_pct, 0.0, 15.0},
       {sentence("%s: settling over the dynamometer's", names.figure),
        synthesized.settling_s / dynamometer.settling_s, 0.8, 2.5}}};
}

std::vector<Finding> estimated(const Runs& runs, const Names& names) {
  const Held dynamometer(runs.at(names.measured));
  const Held fast(runs.at(names.fast));
  const Held synthesized(runs.at(names.synthesized));
  const Held fused(runs.at(names.fused));
  const Held lagged(runs.at(names.lagged));
  return {
      nearly_as_good(names, dynamometer, synthesized, fast),
      {"The power signal alone is too late to control by (about 0.3 s).",
       held_text("Measured power", lagged),
       Outcome::kAgrees,
       "0.1 s of dead time and 0.1 s of lag in the meter, with the gains of the other runs: the "
       "force swings for seconds.",
       {{sentence("%s: settling on the measured power over the synthesized", names.figure),
         std::isfinite(lagged.settling_s) ? lagged.settling_s / synthesized.settling_s : 10.0, 2.5,
         10.0},
        {sentence("%s: deviation at rest on the measured power over the synthesized", names.figure),
         lagged.deviation_pct / synthesized.deviation_pct, 1.5, 20.0}}},
      {"The fused observer in place of the synthesized monitor.",
       held_text("Fused", fused),
       Outcome::kBeside,
       "It has no switch, and less lag and noise.",
       {{sentence("%s: mean error at rest on the fused estimate, %%", names.figure),
         fused.worst_error_pct, 0.0, 3.0}}},
  };
}

std::vector<Finding> variable_measured(const Runs& runs) {
  return {measured(runs.at("p3_fig05"), "P3 Fig. 5")};
}
std::vector<Finding> variable_estimated(const Runs& runs) {
  return estimated(runs, {"P3 Fig. 6", "p3_fig06_dynamometer", "p3_fig06", "p3_fig06_synthesized",
                          "p3_fig06_fused", "p3_fig06_measured"});
}
std::vector<Finding> fuzzy_measured(const Runs& runs) {
  return {measured(runs.at("p3_fig07"), "P3 Fig. 7")};
}
std::vector<Finding> fuzzy_estimated(const Runs& runs) {
  return estimated(runs, {"P3 Fig. 8", "p3_fig08_dynamometer", "p3_fig08", "p3_fig08_synthesized",
                          "p3_fig08_fused", "p3_fig08_measured"});
}

}  // namespace

std::vector<PaperFigure> turning_figures() {
  return {
      {"p3_fig05",
       "P3 Fig. 5",
       "Variable gain on the measured force",
       {{"p3_fig05", "dynamometer"}},
       &variable_measured},
      {"p3_fig06",
       "P3 Fig. 6",
       "Variable gain on the estimated force",
       {{"p3_fig06_dynamometer", "dynamometer"},
        {"p3_fig06_measured", "measured power"},
        {"p3_fig06_synthesized", "synthesized"},
        {"p3_fig06_fused", "fused"},
        {"p3_fig06", "synthesized, as lag and noise"}},
       &variable_estimated},
      {"p3_fig07",
       "P3 Fig. 7",
       "Fuzzy law on the measured force",
       {{"p3_fig07", "dynamometer"}},
       &fuzzy_measured},
      {"p3_fig08",
       "P3 Fig. 8",
       "Fuzzy law on the estimated force",
       {{"p3_fig08_dynamometer", "dynamometer"},
        {"p3_fig08_measured", "measured power"},
        {"p3_fig08_synthesized", "synthesized"},
        {"p3_fig08_fused", "fused"},
        {"p3_fig08", "synthesized, as lag and noise"}},
       &fuzzy_estimated},
  };
}

}  // namespace cutforce::firmware::host
