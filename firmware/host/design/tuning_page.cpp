#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>

#include "firmware/host/design/design_text.hpp"
#include "firmware/host/design/tuning.hpp"
#include "firmware/host/report/assets.hpp"
#include "firmware/host/report/html.hpp"

namespace cutforce::firmware::host {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostPoints = 3000;
constexpr int kHeight = 250;

struct Ink {
  const char* color;
  const char* label;
};
constexpr std::array<Ink, 3> kInks{
    {{"green", "Half the gain"}, {"blue", "The plant's gain"}, {"orange", "Twice the gain"}}};

// Every n-th value, to three digits after those that count: a page is for the eye.
Json thinned(const std::vector<double>& values, std::size_t every) {
  Json out = Json::array();
  for (std::size_t k = 0; k < values.size(); k += every)
    out.push_back(std::round(values[k] * 1e4) / 1e4);
  return out;
}

std::size_t every(std::size_t count) {
  return std::max<std::size_t>(1, (count + kMostPoints - 1) / kMostPoints);
}

std::string holder(const std::string& id, const std::string& heading) {
  return "<div><h3>" + heading + "</h3><div class=\"plot\" id=\"" + id +
         "\" role=\"img\" aria-label=\"" + heading + "\"></div></div>\n";
}

std::string key(std::size_t from, std::size_t to) {
  std::string out = "<div class=\"key\">";
  for (std::size_t k = from; k < to; ++k)
    out += std::string("<span><i data-ink=\"") + kInks[k].color + "\"></i>" + kInks[k].label +
           "</span>";
  return out + "</div>\n";
}

std::string warnings(const std::vector<std::string>& all) {
  std::string out;
  for (const auto& warning : all) out += "<p class=\"warning\">" + escaped(warning) + "</p>\n";
  return out;
}

std::string row(const std::string& name, const std::string& value, const std::string& more) {
  return "<tr><th scope=\"row\">" + escaped(name) + "</th><td class=\"number\">" + escaped(value) +
         "</td><td class=\"note\">" + escaped(more) + "</td></tr>\n";
}

std::string table(const std::string& rows) {
  return "<div class=\"scroll\"><table><tbody>\n" + rows + "</tbody></table></div>\n";
}

std::string give_or_take(const Measured& x) { return "give or take " + brief(x.sigma); }

// Measured force over the recording, with the force of the identified plant.
void add_fit(const Identification& found, Json& plots) {
  const auto& test = found.test;
  const auto& p = found.plant;
  const auto n = every(test.time_s.size());
  auto model = override_response(test.changes,
                                 {.dead_time_s = p.dead_time_s.value,
                                  .lag_s = {p.lag_s.value, p.known_lags_s[0], p.known_lags_s[1]},
                                  .exponent = p.exponent.value,
                                  .reference_pct = p.override_pct},
                                 test.time_s);
  for (double& y : model) y *= p.force_n;
  std::vector<double> override_pct;
  std::size_t at = 0;
  for (const double row_s : test.time_s) {
    while (at + 1 < test.changes.size() && test.changes[at + 1].time_s <= row_s) ++at;
    override_pct.push_back(test.changes[at].override_pct);
  }
  plots.push_back({{"holder", "steps"},
                   {"group", "fit"},
                   {"unit", "%"},
                   {"height", 120},
                   {"time", thinned(test.time_s, n)},
                   {"curves", Json::array({Json{{"ink", "orange"},
                                                {"stepped", true},
                                                {"values", thinned(override_pct, n)}}})}});
  plots.push_back({{"holder", "fit"},
                   {"group", "fit"},
                   {"unit", "N"},
                   {"height", kHeight},
                   {"time", thinned(test.time_s, n)},
                   {"curves",
                    {{{"ink", "truth"}, {"width", 1.2}, {"values", thinned(test.force_n, n)}},
                     {{"ink", "blue"}, {"values", thinned(model, n)}}}}});
}

std::string identified(const Identification& found) {
  const auto& p = found.plant;
  std::string rows =
      row("Gain", brief(p.gain_n_pct.value) + " N/%",
          give_or_take(p.gain_n_pct) + "; at " + brief(p.override_pct) + " % and " +
              brief(p.force_n) + " N") +
      row("Exponent on the feed", brief(p.exponent.value),
          give_or_take(p.exponent) +
              (p.exponent_known ? "" : "; two levels cannot tell it from an offset")) +
      row("Dead time", brief(p.dead_time_s.value) + " s",
          give_or_take(p.dead_time_s) +
              (found.bank ? "; the latency bank says " + brief(found.bank->best_s) + " s" : "")) +
      row("Lag", brief(p.lag_s.value) + " s", give_or_take(p.lag_s)) +
      row("Explained", brief(100.0 * p.explained_ratio) + " %",
          "of the force's variance; residual " + brief(p.residual_n) + " N");
  return "<section><h2>The step test and the plant found in it</h2>\n"
         "<div class=\"key\"><span><i data-ink=\"truth\"></i>Recorded force</span>"
         "<span><i data-ink=\"blue\"></i>Identified plant</span>"
         "<span><i data-ink=\"orange\"></i>Override</span></div>\n"
         "<div class=\"plot\" id=\"fit\" role=\"img\" aria-label=\"Recorded force and "
         "model\"></div>\n"
         "<div class=\"plot\" id=\"steps\" role=\"img\" aria-label=\"Override\"></div>\n" +
         table(rows) + "</section>\n";
}

std::string plant_section(const Tuning& tuning) {
  const auto& p = tuning.plant;
  const std::string rows =
      row("Gain", brief(p.gain_n_pct) + " N/%",
          "at " + brief(p.override_pct()) + " % of override") +
      row("Exponent on the feed", brief(p.exponent), "") +
      row("Dead time", brief(p.latency_s) + " s", "from the override to the feed") +
      row("Lags", brief(p.lag_s) + " s",
          "of the cut; feed drive " + brief(p.feed_lag_s) + " s, sensor " + brief(p.sensor_lag_s) +
              " s") +
      row("Control period", brief(tuning.wish.period_s) + " s", "");
  return "<section><h2>The plant at " + brief(p.reference_n) + " N</h2>\n" + table(rows) +
         warnings(tuning.warnings) + "</section>\n";
}

void add_runs(const TriedProposal& tried, const std::string& id, double reference_n, Json& plots) {
  const auto& first = tried.runs.front();
  const auto n = every(first.time_s.size());
  const auto plot = [&](const char* end, const char* unit, auto member, bool stepped) {
    Json out{{"holder", id + end},
             {"group", id},
             {"unit", unit},
             {"height", kHeight},
             {"from_s", first.time_s.front()},
             {"step_s", (first.time_s[1] - first.time_s[0]) * static_cast<double>(n)},
             {"at_s", {first.deeper_s}},
             {"curves", Json::array()}};
    if (!stepped) out["level"] = reference_n;
    for (std::size_t k = 0; k < tried.runs.size(); ++k)
      out["curves"].push_back({{"ink", kInks[k].color},
                               {"stepped", stepped},
                               {"values", thinned(tried.runs[k].*member, n)}});
    plots.push_back(std::move(out));
  };
  plot("f", "N", &TuningRun::force_n, false);
  plot("u", "%", &TuningRun::override_pct, true);
}

// Without a run: the linear loop's own step, in parts of what is asked for.
void add_linear(const LinearLoop& loop, const std::string& id, double period_s, Json& plots) {
  const auto count = std::min(loop.step.force.size(),
                              static_cast<std::size_t>(std::max(
                                  20.0, 3.0 * std::min(loop.step.settling_s, 100.0) / period_s)));
  const auto plot = [&](const char* end, const std::vector<double>& values, bool stepped) {
    const std::vector<double> shown(values.begin(),
                                    values.begin() + static_cast<std::ptrdiff_t>(count));
    Json out{{"holder", id + end}, {"group", id},        {"unit", ""},  {"height", kHeight},
             {"from_s", 0.0},      {"step_s", period_s}, {"level", 1.0}};
    out["curves"] =
        Json::array({Json{{"ink", "blue"}, {"stepped", stepped}, {"values", thinned(shown, 1)}}});
    plots.push_back(std::move(out));
  };
  plot("f", loop.step.force, false);
  plot("u", loop.step.override, true);
}

std::string or_any(double value, const char* unit) {
  return std::isinf(value) ? "any" : brief(value) + unit;
}

std::string margin_table(const LinearLoop& loop) {
  const auto& m = loop.margins;
  const double degrees = m.phase_rad * 180.0 / std::numbers::pi;
  const auto settles_s = loop.step.settling_s;
  return table(row("Gain margin", or_any(m.gain_ratio, " x"),
                   "stable up to " + or_any(loop.highest_gain_n_pct, " N/%")) +
               row("Phase margin", or_any(degrees, " deg"), "") +
               row("Delay margin", or_any(m.delay_s, " s"), "of dead time more") +
               row("Modulus margin", brief(m.modulus_ratio), "from -1; half and more is good") +
               row("Step of the reference",
                   std::isinf(settles_s) ? "never settles" : brief(settles_s) + " s",
                   "linear, " + brief(100.0 * loop.step.overshoot_ratio) + " % overshoot"));
}

std::string cell(const std::string& text) {
  return "<td class=\"number\">" + escaped(text) + "</td>";
}

std::string step_cells(const StepFigures& step) {
  return cell(brief(100.0 * step.overshoot_ratio) + " %") +
         cell(std::isinf(step.settling_s) ? "never" : brief(step.settling_s) + " s");
}

std::string run_table(const TriedProposal& tried) {
  std::string out =
      "<div class=\"scroll\"><table>\n<thead><tr><th scope=\"col\">Simulated</th>"
      "<th scope=\"col\" class=\"number\">Overshoot from 80 %</th>"
      "<th scope=\"col\" class=\"number\">Settles in</th>"
      "<th scope=\"col\" class=\"number\">Peak, half as deep again</th>"
      "<th scope=\"col\" class=\"number\">Settles in</th></tr></thead><tbody>\n";
  for (std::size_t k = 0; k < tried.runs.size(); ++k) {
    const auto& run = tried.runs[k];
    out += std::string("<tr><th scope=\"row\">") + kInks[k].label + "</th>" +
           (run.rest_pct > kRunCeilingPct ? "<td class=\"number note\" colspan=\"2\">would need " +
                                                brief(run.rest_pct) + " %: at the ceiling</td>"
                                          : step_cells(run.approach)) +
           step_cells(run.deeper) + "</tr>\n";
  }
  return out + "</tbody></table></div>\n<p class=\"note\">" +
         (tried.settles_up_to > 0.0 ? "Settles up to " + brief(tried.settles_up_to) +
                                          " times the gain and half as deep again; 8 times was "
                                          "the most that was tried."
                                    : "Does not settle even at the plant's own gain.") +
         "</p>\n";
}

std::string proposal_section(const TriedProposal& tried, const Tuning& tuning,
                             const std::string& id, Json& plots) {
  const auto& p = tried.proposal;
  std::string out = "<section><h2>" + escaped(p.controller + ", by " + p.rule) + "</h2>\n";
  if (!tried.runs.empty()) {
    add_runs(tried, id, tuning.plant.reference_n, plots);
    out += key(0, kInks.size());
  } else if (!p.linear.empty()) {
    add_linear(p.linear.front(), id, tuning.wish.period_s, plots);
    out += key(1, 2);
  }
  if (!tried.runs.empty() || !p.linear.empty())
    out += "<div class=\"pair\">" + holder(id + "f", "Cutting force") +
           holder(id + "u", "Override") + "</div>\n";
  if (!tried.runs.empty()) out += run_table(tried);
  out += "<div class=\"facts\"><pre class=\"toml\">" + escaped(toml_snippet(p, tuning)) + "</pre>" +
         (p.linear.empty() ? std::string() : margin_table(p.linear.front())) + "</div>\n";
  return out + warnings(p.warnings) + "</section>\n";
}

}  // namespace

std::string tuning_page(const Tuning& tuning) {
  Json plots = Json::array();
  std::string plant;
  if (tuning.identification) {
    add_fit(*tuning.identification, plots);
    plant = identified(*tuning.identification);
  }
  plant += plant_section(tuning);
  std::string proposals;
  for (std::size_t k = 0; k < tuning.proposals.size(); ++k)
    proposals += proposal_section(tuning.proposals[k], tuning, "p" + std::to_string(k), plots);
  const std::string title = "Gains for " + brief(tuning.plant.reference_n) + " N, settling in " +
                            brief(tuning.wish.settling_s) + " s";
  const std::string lead = tuning.identification
                               ? "From the step test " + tuning.identification->test.where + "."
                               : std::string("From a plant given as numbers.");
  return fill(assets::kTuningPage, {{"title", escaped(title)},
                                    {"lead", escaped(lead)},
                                    {"plant", plant},
                                    {"proposals", proposals},
                                    {"licence", escaped(assets::kPlotLicence)},
                                    {"data", script_safe(plots.dump())},
                                    {"plot_style", std::string(assets::kPlotStyle)},
                                    {"style", std::string(assets::kStyle)},
                                    {"plot_script", std::string(assets::kPlotScript)},
                                    {"script", std::string(assets::kTuningScript)}});
}

}  // namespace cutforce::firmware::host
