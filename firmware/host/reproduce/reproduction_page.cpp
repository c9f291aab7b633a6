// The reproduction as a page: a table of statements, then a section for each figure.
#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "firmware/host/report/assets.hpp"
#include "firmware/host/report/html.hpp"
#include "firmware/host/report/page_data.hpp"
#include "firmware/host/reproduce/reproduction.hpp"

namespace cutforce::firmware::host {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostRows = 4000;  // of a curve

std::string outcome_cell(const Finding& finding) {
  const bool fails = !std::ranges::all_of(finding.checks, &Check::holds);
  const std::string word(fails ? "fails" : name_of(finding.outcome));
  return "<td class=\"outcome " + std::string(word) + "\">" + word + "</td>";
}

std::string head(std::initializer_list<const char*> names) {
  std::string cells;
  for (const char* name : names) cells += "<th scope=\"col\">" + std::string(name) + "</th>";
  return "<thead><tr>" + cells + "</tr></thead>";
}

// `figure`: a cell that names it, once.
std::string overview_rows(const std::vector<Finding>& findings, const std::string& figure) {
  std::string rows;
  for (const Finding& finding : findings) {
    rows += "<tr><td>" + (rows.empty() ? figure : "") + "</td><td>" + escaped(finding.said) +
            "</td><td>" + escaped(finding.got) + "</td>" + outcome_cell(finding) + "</tr>\n";
  }
  return rows;
}

std::string link(std::string_view anchor, std::string_view text) {
  return "<a href=\"#" + std::string(anchor) + "\">" + escaped(text) + "</a>";
}

std::string overview_section(const Reproduction& reproduction) {
  std::string rows;
  for (const JudgedFigure& judged : reproduction.figures) {
    rows += overview_rows(judged.findings, link(judged.figure.name, judged.figure.paper));
  }
  rows += overview_rows(reproduction.equations, link("equations", "Equations"));
  return "<section><h2>What the papers say, and what comes out</h2>\n<div class=\"scroll\">"
         "<table class=\"findings overview\">" +
         head({"Figure", "The paper says", "Here", ""}) + "<tbody>\n" + rows +
         "</tbody></table></div></section>\n";
}

std::string finding_table(const std::vector<Finding>& findings) {
  std::string rows;
  for (const Finding& finding : findings) {
    rows += "<tr><td>" + escaped(finding.said) + "</td><td>" + escaped(finding.got) + "</td>" +
            outcome_cell(finding) + "<td class=\"note\">" + escaped(finding.reason) +
            "</td></tr>\n";
  }
  return "<div class=\"scroll\"><table class=\"findings\">" +
         head({"The paper says", "Here", "", "Why, or what else"}) + "<tbody>\n" + rows +
         "</tbody></table></div>\n";
}

std::string figure_section(const JudgedFigure& judged) {
  const std::string name(judged.figure.name);
  return "<section id=\"" + name + "\"><h2>" + escaped(judged.figure.paper) + ": " +
         escaped(judged.figure.title) + "</h2>\n<div class=\"plots\" id=\"plots-" + name +
         "\"></div>\n" + finding_table(judged.findings) + "</section>\n";
}

std::string equation_section(const Reproduction& reproduction) {
  if (reproduction.equations.empty()) return {};
  return "<section id=\"equations\"><h2>The papers' equations</h2>\n" +
         finding_table(reproduction.equations) + "</section>\n";
}

std::string check_rows(const std::vector<Finding>& findings) {
  std::string rows;
  for (const Finding& finding : findings) {
    for (const Check& check : finding.checks) {
      rows += "<tr><td>" + escaped(check.name) + "</td><td class=\"number\">" +
              sentence("%.6g", check.value) + "</td><td class=\"number\">" +
              sentence("%.6g", check.least) + "</td><td class=\"number\">" +
              sentence("%.6g", check.most) + "</td><td class=\"outcome " +
              (check.holds() ? "agrees\">holds" : "fails\">fails") + "</td></tr>\n";
    }
  }
  return rows;
}

std::string check_section(const Reproduction& reproduction) {
  std::string rows = check_rows(reproduction.equations);
  for (const JudgedFigure& judged : reproduction.figures) rows += check_rows(judged.findings);
  return "<section><details open><summary>Numbers that must come out</summary>\n"
         "<div class=\"scroll\"><table class=\"checks\"><thead><tr><th scope=\"col\">What</th>"
         "<th scope=\"col\" class=\"number\">Value</th><th scope=\"col\" class=\"number\">Least"
         "</th><th scope=\"col\" class=\"number\">Most</th><th scope=\"col\"></th></tr></thead>"
         "<tbody>\n" +
         rows + "</tbody></table></div></details></section>\n";
}

// The last value at or before each time of the grid.
std::string held(const std::vector<double>& time_s, const std::vector<double>& values,
                 double step_s, std::size_t count) {
  std::vector<float> out(count, std::numeric_limits<float>::quiet_NaN());
  std::size_t at = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double now_s = step_s * static_cast<double>(k) + 1e-9;
    while (at < time_s.size() && time_s[at] <= now_s) ++at;
    const bool over = at == time_s.size() && time_s.back() + 1.5 * step_s < now_s;
    if (at > 0 && !over) out[k] = static_cast<float>(values[at - 1]);
  }
  return base64(out);
}

Json figure_json(const JudgedFigure& judged, const Runs& runs) {
  double end_s = 0.0;
  double finest_s = 0.05;
  double reference_n = 0.0;
  for (const FigureRun& entry : judged.figure.runs) {
    const ClosedLoop& run = runs.find(entry.scenario)->second;
    end_s = std::max(end_s, run.time_s.back());
    finest_s = std::min(finest_s, (run.time_s.back() - run.time_s.front()) /
                                      static_cast<double>(run.time_s.size()));
    reference_n = run.reference_n;
  }
  const double step_s = std::max(finest_s, end_s / static_cast<double>(kMostRows));
  const auto count = static_cast<std::size_t>(end_s / step_s) + 1;
  Json json{{"name", judged.figure.name},
            {"reference_n", reference_n},
            {"time", {{"from_s", 0.0}, {"step_s", step_s}, {"count", count}}},
            {"runs", Json::array()}};
  for (const FigureRun& entry : judged.figure.runs) {
    const ClosedLoop& run = runs.find(entry.scenario)->second;
    json["runs"].push_back({{"name", entry.label},
                            {"scenario", entry.scenario},
                            {"force", held(run.time_s, run.force_n, step_s, count)},
                            {"override", held(run.tick_s, run.override_pct, step_s, count)}});
  }
  return json;
}

}  // namespace

std::string reproduction_page(const Reproduction& reproduction) {
  std::string sections;
  Json data = Json::array();
  for (const JudgedFigure& judged : reproduction.figures) {
    sections += figure_section(judged);
    data.push_back(figure_json(judged, reproduction.runs));
  }
  return fill(
      assets::kReproductionPage,
      {{"title", "The papers' figures, run again"},
       {"lead",
        "Every run is simulated: the laws as printed, then the same corrected where they do "
        "not work. Where a statement does not come out, the table says why; what no paper says is "
        "marked beside. P3's Figs. 1 and 2 show the estimate itself: cutforce demo draws them, "
        "cutforce evaluate measures them."},
       {"overview", overview_section(reproduction)},
       {"figures", sections},
       {"equations", equation_section(reproduction)},
       {"checks", check_section(reproduction)},
       {"licence", escaped(assets::kPlotLicence)},
       {"data", script_safe(data.dump())},
       {"plot_style", std::string(assets::kPlotStyle)},
       {"style", std::string(assets::kStyle)},
       {"plot_script", std::string(assets::kPlotScript)},
       {"script", std::string(assets::kReproductionScript)}});
}

}  // namespace cutforce::firmware::host
