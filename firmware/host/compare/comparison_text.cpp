#include "firmware/host/compare/comparison_text.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace cutforce::firmware::host {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kBound = "oracle_detected";

double settling_s(const Comparison& comparison, const ComparisonRow& row, std::string_view part) {
  const std::size_t k = comparison.part_index(part);
  return k < row.cells.size() ? row.cells[k].mean.settling_s : -1.0;
}

std::string shown_or_dash(bool known, double value, int decimals) {
  return known ? fixed(value, decimals) : "-";
}

std::string padded(const std::string& text, std::size_t width, bool right) {
  const std::string space(text.size() < width ? width - text.size() : 0, ' ');
  return right ? space + text : text + space;
}

// The first column to the left, the others to the right.
std::string aligned(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (std::size_t k = 0; k < row.size(); ++k) widths[k] = std::max(widths[k], row[k].size());
  }
  std::string text;
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t k = 0; k < row.size(); ++k) {
      line += padded(row[k], widths[k], k > 0) + (k + 1 < row.size() ? "  " : "");
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

std::string impulse_table(const Comparison& comparison) {
  std::vector<std::vector<std::string>> rows{{"I105 [N s]"}};
  for (const Part& part : comparison.parts) rows[0].push_back(part.name);
  for (const ComparisonRow& row : comparison.rows) {
    rows.push_back({std::string(row.contender->name)});
    for (const ComparisonCell& cell : row.cells) {
      rows.back().push_back(fixed(cell.mean.impulse_105_ns, 1));
    }
  }
  return aligned(rows);
}

std::string goal_table(const std::vector<Goal>& goals) {
  std::vector<std::vector<std::string>> rows{{"Goal", "is", "wanted", ""}};
  for (const Goal& goal : goals) {
    rows.push_back({std::to_string(goal.number) + ". " + goal.text, fixed(goal.value, 3),
                    (goal.at_most ? "<= " : ">= ") + fixed(goal.limit, 3),
                    goal.reached() ? "reached" : "NOT REACHED"});
  }
  return aligned(rows);
}

Json json_of(const PartMetrics& m) {
  Json json{{"impulse_105_n_s", m.impulse_105_ns},
            {"impulse_n_s", m.impulse_ns},
            {"shortfall_n_s", m.shortfall_ns},
            {"peak_ratio", m.peak_ratio},
            {"above_110_s", m.above_110_s},
            {"rms_ratio", m.rms_ratio},
            {"mean_ratio", m.mean_ratio},
            {"time_s", m.time_s},
            {"changes", m.changes},
            {"finished", m.finished}};
  if (m.settling_s >= 0.0) json["settling_s"] = m.settling_s;
  return json;
}

Json json_of(const ComparisonRow& row, const Comparison& comparison) {
  Json json{{"name", row.contender->name},
            {"title", row.contender->title},
            {"kind", row.contender->oracle ? "oracle" : "controller"},
            {"total", json_of(row.total)}};
  if (const ComparisonRow* bound = comparison.find(kBound); bound != nullptr) {
    json["ratio_to_oracle_detected"] = row.total.impulse_105_ns / bound->total.impulse_105_ns;
  }
  if (comparison.robustness && !row.contender->oracle) {
    json["robustness"] = {{"gain_up_ratio", row.robustness.gain_up_ratio},
                          {"gain_down_ratio", row.robustness.gain_down_ratio},
                          {"latency_s", nullptr}};
    if (row.robustness.latency_s >= 0.0) json["robustness"]["latency_s"] = row.robustness.latency_s;
  }
  json["parts"] = Json::array();
  for (std::size_t k = 0; k < row.cells.size(); ++k) {
    Json part = json_of(row.cells[k].mean);
    part["name"] = comparison.parts[k].name;
    part["seeds"] = Json::array();
    for (const PartMetrics& seed : row.cells[k].seeds) part["seeds"].push_back(json_of(seed));
    json["parts"].push_back(std::move(part));
  }
  return json;
}

}  // namespace

std::string fixed(double value, int decimals) {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

const char* name_of(Surroundings surroundings) {
  constexpr std::array<const char*, 3> kSurroundings{"exact", "noise", "random"};
  return kSurroundings[static_cast<std::size_t>(surroundings)];
}

const std::vector<SummaryColumn>& summary_columns() {
  static const std::vector<SummaryColumn> kColumns{
      {"I105", "N s", "force above 105 % of the reference, over all parts"},
      {"ratio", "", "of that to the oracle that sees a change of 30 N"},
      {"peak", "Fr", "highest force, over the reference"},
      {"t110", "s", "time above 110 %"},
      {"s1.5", "s", "within 5 % for good after a step of depth to 1.5 times"},
      {"s4", "s", "the same, to 4 times"},
      {"rms", "%", "error in the cut and below the ceiling"},
      {"time", "s", "for all parts"},
      {"changes", "", "of the override"},
      {"up", "", "jump of the process gain from 1 mm up to which the loop comes to rest"},
      {"down", "", "the same, down to 1 mm"},
      {"latency", "s", "true latency up to which the loop comes to rest, 25 ms being usual"}};
  return kColumns;
}

std::vector<std::string> summary_of(const Comparison& comparison, const ComparisonRow& row) {
  const PartMetrics& t = row.total;
  const ComparisonRow* bound = comparison.find(kBound);
  const double s15 = settling_s(comparison, row, "step1.5");
  const double s4 = settling_s(comparison, row, "step4");
  const bool robust = comparison.robustness && !row.contender->oracle;
  return {fixed(t.impulse_105_ns, 1),
          shown_or_dash(bound != nullptr && bound->total.impulse_105_ns > 0.0,
                        bound == nullptr ? 0.0 : t.impulse_105_ns / bound->total.impulse_105_ns, 2),
          fixed(t.peak_ratio, 2),
          fixed(t.above_110_s, 1),
          shown_or_dash(s15 >= 0.0, s15, 2),
          shown_or_dash(s4 >= 0.0, s4, 2),
          fixed(100.0 * t.rms_ratio, 1),
          fixed(t.time_s, 1) + (t.finished ? "" : "*"),
          fixed(t.changes, 0),
          shown_or_dash(robust, row.robustness.gain_up_ratio, 1),
          shown_or_dash(robust, row.robustness.gain_down_ratio, 1),
          shown_or_dash(robust && row.robustness.latency_s >= 0.0, row.robustness.latency_s, 2)};
}

std::string comparison_table(const Comparison& comparison, const std::vector<Goal>& goals) {
  std::vector<std::vector<std::string>> rows{{"Contender"}, {""}};
  for (const SummaryColumn& column : summary_columns()) {
    rows[0].push_back(column.head);
    rows[1].push_back(column.unit);
  }
  bool finished = true;
  for (const ComparisonRow& row : comparison.rows) {
    rows.push_back({std::string(row.contender->name)});
    for (std::string& text : summary_of(comparison, row)) rows.back().push_back(std::move(text));
    finished = finished && row.total.finished;
  }
  std::string text = aligned(rows) + "\n" + impulse_table(comparison) + "\n";
  if (!goals.empty()) text += goal_table(goals) + "\n";
  for (const SummaryColumn& column : summary_columns()) {
    text += padded(column.head, 9, false) + column.meaning + "\n";
  }
  if (!finished) text += "*        a part was not finished in time\n";
  text += "Surroundings: " + std::string(name_of(comparison.surroundings)) + "; means of " +
          std::to_string(comparison.seeds) + " seeds. All of it is simulation.\n";
  return text;
}

Json comparison_json(const Comparison& comparison, const std::vector<Goal>& goals) {
  Json json{{"surroundings", name_of(comparison.surroundings)},
            {"seeds", comparison.seeds},
            {"parts", Json::array()},
            {"contenders", Json::array()},
            {"goals", Json::array()}};
  for (const Part& part : comparison.parts) {
    json["parts"].push_back({{"name", part.name}, {"title", part.title}});
  }
  for (const ComparisonRow& row : comparison.rows) {
    json["contenders"].push_back(json_of(row, comparison));
  }
  for (const Goal& goal : goals) {
    json["goals"].push_back({{"number", goal.number},
                             {"text", goal.text},
                             {"value", goal.value},
                             {"limit", goal.limit},
                             {"at_most", goal.at_most},
                             {"reached", goal.reached()}});
  }
  return json;
}

}  // namespace cutforce::firmware::host
