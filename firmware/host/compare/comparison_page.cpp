#include "firmware/host/compare/comparison_page.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "firmware/host/compare/comparison_text.hpp"
#include "firmware/host/report/assets.hpp"
#include "firmware/host/report/html.hpp"

namespace cutforce::firmware::host {
namespace {

using Json = nlohmann::ordered_json;

// What a person sees first; a click shows the others.
constexpr std::array<std::string_view, 4> kShown{"predictive", "pi_tuned", "linuxcnc_pid",
                                                 "oracle_detected"};

std::string cell(const std::string& tag, const std::string& attributes, const std::string& text) {
  return "<" + tag + (attributes.empty() ? "" : " " + attributes) + ">" + text + "</" + tag + ">";
}

std::string table_section(const std::string& title, const std::string& style,
                          const std::string& head, const std::string& body) {
  return "<section><h2>" + title + "</h2>\n<div class=\"scroll\"><table class=\"" + style +
         "\">\n<thead><tr>" + head + "</tr></thead>\n<tbody>\n" + body +
         "</tbody></table></div></section>";
}

std::string summary_section(const Comparison& comparison) {
  std::string head =
      cell("th", "scope=\"col\"", "Contender") + cell("th", "scope=\"col\" class=\"bars\"", "I105");
  for (const SummaryColumn& column : summary_columns()) {
    head += cell("th", "scope=\"col\" class=\"number\" title=\"" + escaped(column.meaning) + "\"",
                 escaped(column.head + (column.unit.empty() ? "" : ", " + column.unit)));
  }
  double most_ns = 1e-9;
  for (const auto& row : comparison.rows) most_ns = std::max(most_ns, row.total.impulse_105_ns);
  std::string body;
  for (const ComparisonRow& row : comparison.rows) {
    const bool oracle = row.contender->oracle.has_value();
    body += row.contender->name == kShown[0] ? "<tr class=\"subject\">" : "<tr>";
    body += cell("th", "scope=\"row\" title=\"" + escaped(row.contender->title) + "\"",
                 escaped(row.contender->name));
    body += cell("td", "",
                 "<span class=\"bar" + std::string(oracle ? " oracle" : "") + "\" style=\"width:" +
                     fixed(100.0 * row.total.impulse_105_ns / most_ns, 2) + "%\"></span>");
    for (const std::string& text : summary_of(comparison, row)) {
      body += cell("td", "class=\"number\"", text);
    }
    body += "</tr>\n";
  }
  return table_section("Sum over the parts", "figures dense", head, body);
}

std::string impulse_section(const Comparison& comparison) {
  std::string head = cell("th", "scope=\"col\"", "I105, N s");
  for (const Part& part : comparison.parts) {
    head += cell("th", "scope=\"col\" class=\"number\"",
                 "<a href=\"#part-" + escaped(part.name) + "\">" + escaped(part.name) + "</a>");
  }
  // The best of the controllers of one pass is set off.
  std::vector<double> least(comparison.parts.size(), 1e30);
  for (const ComparisonRow& row : comparison.rows) {
    if (row.contender->oracle || row.contender->pass > 1) continue;
    for (std::size_t k = 0; k < least.size(); ++k) {
      least[k] = std::min(least[k], row.cells[k].mean.impulse_105_ns);
    }
  }
  std::string body;
  for (const ComparisonRow& row : comparison.rows) {
    body += "<tr>" + cell("th", "scope=\"row\"", escaped(row.contender->name));
    const bool judged = !row.contender->oracle && row.contender->pass == 1;
    for (std::size_t k = 0; k < least.size(); ++k) {
      const double here = row.cells[k].mean.impulse_105_ns;
      body += cell("td", judged && here <= least[k] ? "class=\"number least\"" : "class=\"number\"",
                   fixed(here, 1));
    }
    body += "</tr>\n";
  }
  return table_section("Force above 105 % of the reference, by part", "figures dense", head, body);
}

std::string goal_rows(const std::vector<Goal>& goals, bool reached) {
  std::string body;
  for (const Goal& goal : goals) {
    if (goal.reached() != reached) continue;
    body +=
        "<tr>" +
        cell("th", "scope=\"row\"", std::to_string(goal.number) + ". " + escaped(goal.text)) +
        cell("td", "class=\"number\"", fixed(goal.value, 3)) +
        cell("td", "class=\"number\"", (goal.at_most ? "&le; " : "&ge; ") + fixed(goal.limit, 3)) +
        cell("td", reached ? "" : "class=\"missed\"", reached ? "reached" : "not reached") +
        "</tr>\n";
  }
  return body;
}

// What is missed stands open, the rest behind a click.
std::string goal_section(const std::vector<Goal>& goals) {
  if (goals.empty()) return {};
  const std::string head =
      "<table class=\"figures dense\">\n<thead><tr>" + cell("th", "scope=\"col\"", "Goal") +
      cell("th", "scope=\"col\" class=\"number\"", "Is") +
      cell("th", "scope=\"col\" class=\"number\"", "Wanted") + "<th></th></tr></thead>\n<tbody>\n";
  const auto reached = std::ranges::count_if(goals, &Goal::reached);
  const bool all = static_cast<std::size_t>(reached) == goals.size();
  return "<section><h2>Goals of the predictive law: " + std::to_string(reached) + " of " +
         std::to_string(goals.size()) + " reached</h2>\n<div class=\"scroll\">" +
         (all ? "" : head + goal_rows(goals, false) + "</tbody></table>") +
         "<details><summary>The goals that are reached</summary>" + head + goal_rows(goals, true) +
         "</tbody></table></details></div></section>";
}

Json whole_numbers(const std::vector<float>& values) {
  Json list = Json::array();
  for (const float value : values) list.push_back(static_cast<int>(std::lround(value)));
  return list;
}

std::string embedded(const Comparison& comparison) {
  Json json{{"step_s", kTraceStep_s},
            {"reference_n", PartLimits{}.reference_n},
            {"contenders", Json::array()},
            {"parts", Json::array()}};
  for (const ComparisonRow& row : comparison.rows) {
    const bool few = comparison.rows.size() <= kShown.size();
    const auto place = std::ranges::find(kShown, row.contender->name) - kShown.begin();
    const bool shown = few || static_cast<std::size_t>(place) < kShown.size();
    json["contenders"].push_back({{"name", row.contender->name},
                                  {"title", row.contender->title},
                                  {"oracle", row.contender->oracle.has_value()},
                                  {"shown", shown},
                                  {"place", place}});
  }
  for (std::size_t k = 0; k < comparison.parts.size(); ++k) {
    const Part& part = comparison.parts[k];
    Json cuts = Json::array();
    for (const ComparisonRow& row : comparison.rows) {
      cuts.push_back({{"force", whole_numbers(row.cells[k].trace.force_n)},
                      {"override", whole_numbers(row.cells[k].trace.override_pct)}});
    }
    json["parts"].push_back({{"name", part.name}, {"title", part.title}, {"cuts", cuts}});
  }
  return json.dump();
}

}  // namespace

std::string comparison_page(const Comparison& comparison, const std::vector<Goal>& goals) {
  const std::string lead = "Surroundings: " + std::string(name_of(comparison.surroundings)) +
                           "; means of " + std::to_string(comparison.seeds) +
                           " seeds. I105 is the force above 105 % of the reference, summed over "
                           "time: what overloads the tool.";
  return fill(assets::kComparePage, {{"part_count", std::to_string(comparison.parts.size())},
                                     {"lead", escaped(lead)},
                                     {"summary", summary_section(comparison)},
                                     {"goals", goal_section(goals)},
                                     {"impulses", impulse_section(comparison)},
                                     {"licence", escaped(assets::kPlotLicence)},
                                     {"data", script_safe(embedded(comparison))},
                                     {"plot_style", std::string(assets::kPlotStyle)},
                                     {"style", std::string(assets::kStyle)},
                                     {"plot_script", std::string(assets::kPlotScript)},
                                     {"script", std::string(assets::kCompareScript)}});
}

}  // namespace cutforce::firmware::host
