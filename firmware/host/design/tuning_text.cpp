#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "firmware/host/design/design_text.hpp"
#include "firmware/host/design/tuning.hpp"

namespace cutforce::firmware::host {
namespace {

using Json = nlohmann::ordered_json;

std::string measured(const Measured& x) { return brief(x.value) + " +- " + brief(x.sigma); }

std::string percent(double ratio) { return brief(100.0 * ratio) + " %"; }

std::string settling(double s) {
  return std::isinf(s) ? "never settles" : "settles in " + brief(s) + " s";
}

std::string step_text(const StepFigures& step) {
  return "+" + percent(step.overshoot_ratio) + ", " + settling(step.settling_s);
}

std::string row(const std::string& name, const std::string& text) {
  constexpr std::size_t kColumn = 15;
  std::string line = "  " + name;
  line.resize(std::max(kColumn, line.size() + 1), ' ');
  return line + text + "\n";
}

std::string identification_text(const Identification& found) {
  const auto& p = found.plant;
  std::string out = "Step test " + found.test.where + " (" + found.test.force_column + ", " +
                    std::to_string(p.rows) + " rows, " + std::to_string(p.steps) + " changes)\n";
  out += row("gain", measured(p.gain_n_pct) + " N/% at " + brief(p.override_pct) + " % and " +
                         brief(p.force_n) + " N");
  out += row("exponent", measured(p.exponent) +
                             (p.exponent_known ? ""
                                               : "; of two levels only, where an offset of the "
                                                 "force looks the same"));
  out += row("dead time", measured(p.dead_time_s) + " s" +
                              (found.bank ? "; latency bank: " + brief(found.bank->best_s) + " s"
                                          : std::string()));
  out += row("lag", measured(p.lag_s) + " s");
  out += row("fit", "explains " + percent(p.explained_ratio) + " of the variance, residual " +
                        brief(p.residual_n) + " N");
  return out + "\n";
}

std::string plant_text(const Tuning& tuning) {
  const auto& p = tuning.plant;
  std::string out = "Plant at " + brief(p.reference_n) + " N\n";
  out += row("gain", brief(p.gain_n_pct) + " N/% at " + brief(p.override_pct()) + " %, exponent " +
                         brief(p.exponent));
  out += row("dead time", brief(p.latency_s) + " s");
  out += row("lags", "cut " + brief(p.lag_s) + " s, feed drive " + brief(p.feed_lag_s) +
                         " s, sensor " + brief(p.sensor_lag_s) + " s");
  return out;
}

std::string run_name(const TuningRun& run) {
  if (run.gain_ratio == 1.0) return "simulated";
  return run.gain_ratio < 1.0 ? "half the gain" : "twice the gain";
}

std::string run_text(const TuningRun& run) {
  const std::string approach = run.rest_pct > kRunCeilingPct
                                   ? "would need " + brief(run.rest_pct) + " %: at the ceiling"
                                   : step_text(run.approach);
  return "from 80 %: " + approach + "; half as deep again: " + step_text(run.deeper);
}

Json finite(double x) { return std::isfinite(x) ? Json(x) : Json(nullptr); }

Json step_json(const StepFigures& step) {
  return {{"overshoot_ratio", step.overshoot_ratio}, {"settling_s", finite(step.settling_s)}};
}
Json measured_json(const Measured& x) { return {{"value", x.value}, {"sigma", x.sigma}}; }

Json identification_json(const Identification& found) {
  const auto& p = found.plant;
  Json out{{"recording", found.test.where},
           {"force_column", found.test.force_column},
           {"gain_n_pct", measured_json(p.gain_n_pct)},
           {"exponent", measured_json(p.exponent)},
           {"exponent_known", p.exponent_known},
           {"dead_time_s", measured_json(p.dead_time_s)},
           {"lag_s", measured_json(p.lag_s)},
           {"override_pct", p.override_pct},
           {"force_n", p.force_n},
           {"residual_n", p.residual_n},
           {"explained_ratio", p.explained_ratio},
           {"slow_residual", p.slow_residual},
           {"rows", p.rows},
           {"steps", p.steps}};
  if (found.bank)
    out["latency_bank"] = {{"best_s", found.bank->best_s},
                           {"latency_s", found.bank->latency_s},
                           {"cost", found.bank->cost},
                           {"ticks", found.bank->ticks}};
  return out;
}

Json proposal_json(const TriedProposal& tried, const Tuning& tuning) {
  const auto& p = tried.proposal;
  Json out{{"controller", p.controller},
           {"rule", p.rule},
           {"wish_met", p.wish_met},
           {"settings", Json::object()},
           {"toml", toml_snippet(p, tuning)}};
  for (const auto& setting : p.settings) out["settings"][setting.key] = std::stod(setting.value);
  if (!p.linear.empty()) {
    const auto& loop = p.linear.front();
    const auto& m = loop.margins;
    out["margins"] = {{"stable", m.stable},
                      {"gain_ratio", finite(m.gain_ratio)},
                      {"phase_deg", finite(m.phase_rad * 180.0 / std::numbers::pi)},
                      {"delay_s", finite(m.delay_s)},
                      {"modulus_ratio", m.modulus_ratio},
                      {"highest_gain_n_pct", finite(loop.highest_gain_n_pct)}};
    out["linear_step"] = step_json({loop.step.overshoot_ratio, loop.step.settling_s});
  }
  out["simulated"] = Json::array();
  for (const auto& run : tried.runs)
    out["simulated"].push_back({{"gain_ratio", run.gain_ratio},
                                {"rest_override_pct", run.rest_pct},
                                {"approach", step_json(run.approach)},
                                {"half_as_deep_again", step_json(run.deeper)}});
  if (!tried.runs.empty()) out["settles_up_to_gain_ratio"] = tried.settles_up_to;
  out["warnings"] = p.warnings;
  return out;
}

std::string proposal_text(const TriedProposal& tried, const Tuning& tuning) {
  const auto& p = tried.proposal;
  std::string out =
      "\n# " + p.controller + ", by " + p.rule + "\n" + toml_snippet(p, tuning) + "\n";
  for (const auto& loop : p.linear) {
    out += row("margins", margin_text(loop.margins));
    out += row("highest gain", std::isinf(loop.highest_gain_n_pct)
                                   ? std::string("any")
                                   : brief(loop.highest_gain_n_pct) + " N/% (" +
                                         brief(loop.margins.gain_ratio) + " times the plant's)");
    out += row("linear step", step_text({loop.step.overshoot_ratio, loop.step.settling_s}));
  }
  for (const auto& run : tried.runs) out += row(run_name(run), run_text(run));
  if (!tried.runs.empty())
    out += row("settles", tried.settles_up_to > 0.0
                              ? "up to " + brief(tried.settles_up_to) +
                                    " times the gain and half as deep again (8 times tried)"
                              : std::string("not even at the plant's own gain"));
  for (const auto& warning : p.warnings) out += row("warning", warning);
  return out;
}

}  // namespace

std::string toml_snippet(const Proposal& proposal, const Tuning& tuning) {
  std::string out = "[estimator]\ncontrol_period_s = " + number(tuning.wish.period_s) +
                    "\n[control]\ncontroller = \"" + proposal.controller +
                    "\"\nforce_reference_n = " + number(rounded(tuning.plant.reference_n)) + "\n";
  for (const auto& setting : proposal.settings) out += setting.key + " = " + setting.value + "\n";
  return out;
}

std::string tuning_text(const Tuning& tuning) {
  std::string out;
  if (tuning.identification) out += identification_text(*tuning.identification);
  out += plant_text(tuning);
  for (const auto& warning : tuning.warnings) out += row("warning", warning);
  for (const auto& tried : tuning.proposals) out += proposal_text(tried, tuning);
  return out;
}

Json tuning_json(const Tuning& tuning) {
  const auto& p = tuning.plant;
  Json out{{"plant",
            {{"gain_n_pct", p.gain_n_pct},
             {"exponent", p.exponent},
             {"lag_s", p.lag_s},
             {"latency_s", p.latency_s},
             {"feed_lag_s", p.feed_lag_s},
             {"sensor_lag_s", p.sensor_lag_s},
             {"reference_n", p.reference_n},
             {"override_pct", p.override_pct()}}},
           {"settling_s", tuning.wish.settling_s},
           {"period_s", tuning.wish.period_s}};
  if (tuning.identification) out["identification"] = identification_json(*tuning.identification);
  out["proposals"] = Json::array();
  for (const auto& tried : tuning.proposals)
    out["proposals"].push_back(proposal_json(tried, tuning));
  out["warnings"] = tuning.warnings;
  return out;
}

}  // namespace cutforce::firmware::host
