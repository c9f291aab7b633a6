#include "firmware/host/reproduce/reproduction.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "firmware/host/reproduce/paper_scenarios.hpp"
#include "firmware/host/unit_hint.hpp"

namespace cutforce::firmware::host {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kLine = 96;

bool all_hold(const std::vector<Finding>& findings) {
  return std::ranges::all_of(findings, [](const Finding& finding) {
    return std::ranges::all_of(finding.checks, &Check::holds);
  });
}

std::expected<ClosedLoop, std::vector<InputError>> run_named(std::string_view name) {
  const auto found = std::ranges::find(paper_scenarios(), name, &PaperScenario::name);
  if (found == paper_scenarios().end()) {
    return std::unexpected{std::vector{
        InputError{std::string(name), "the program does not carry this scenario", "rebuild it"}}};
  }
  const auto scenario = parse_scenario(found->text, std::string(name) + ".toml");
  if (!scenario) return std::unexpected{scenario.error()};
  auto run = run_closed_loop(*scenario);
  if (!run) return std::unexpected{std::vector{run.error()}};
  return std::move(*run);
}

// "  " and the text, broken at spaces.
std::string wrapped(const std::string& indent, std::string text) {
  std::string out;
  while (!text.empty()) {
    std::size_t end = text.size();
    if (indent.size() + end > kLine) {
      end = text.rfind(' ', kLine - indent.size());
      if (end == std::string::npos || end == 0) end = std::min(text.find(' '), text.size());
    }
    out += (out.empty() ? "" : std::string(indent.size(), ' ')) + text.substr(0, end) + "\n";
    text.erase(0, std::min(end + 1, text.size()));
  }
  return indent + out;
}

std::string finding_text(const Finding& finding) {
  const bool beside = finding.outcome == Outcome::kBeside;
  std::string text = wrapped(beside ? "  beside  " : "  paper   ", finding.said) +
                     wrapped("  here    ", finding.got);
  if (!finding.reason.empty()) {
    const bool differs = finding.outcome == Outcome::kDiffers;
    text += wrapped(differs ? "  differs " : "  note    ", finding.reason);
  }
  for (const Check& check : finding.checks) {
    if (check.holds()) continue;
    text += wrapped("  FAILS   ", check.name + sentence(": %.6g, not within %.6g to %.6g",
                                                        check.value, check.least, check.most));
  }
  return text + "\n";
}

Json finding_json(const Finding& finding) {
  Json checks = Json::array();
  for (const Check& check : finding.checks) {
    checks.push_back({{"name", check.name},
                      {"value", std::isfinite(check.value) ? Json(check.value) : Json(nullptr)},
                      {"least", check.least},
                      {"most", check.most},
                      {"holds", check.holds()}});
  }
  return {{"paper", finding.said},
          {"here", finding.got},
          {"outcome", name_of(finding.outcome)},
          {"reason", finding.reason},
          {"checks", std::move(checks)}};
}

Json findings_json(const std::vector<Finding>& findings) {
  Json list = Json::array();
  for (const Finding& finding : findings) list.push_back(finding_json(finding));
  return list;
}

struct Count {
  int findings = 0;
  int agree = 0;
  int checks = 0;
  int hold = 0;
};

void add(Count& count, const std::vector<Finding>& findings) {
  for (const Finding& finding : findings) {
    if (finding.outcome != Outcome::kBeside) ++count.findings;
    if (finding.outcome == Outcome::kAgrees) ++count.agree;
    count.checks += static_cast<int>(finding.checks.size());
    count.hold += static_cast<int>(std::ranges::count_if(finding.checks, &Check::holds));
  }
}

}  // namespace

bool Reproduction::holds() const {
  return all_hold(equations) && std::ranges::all_of(figures, [](const JudgedFigure& figure) {
           return all_hold(figure.findings);
         });
}

std::expected<Reproduction, std::vector<InputError>> reproduce(std::string_view figure) {
  Reproduction all{};
  auto figures = paper_figures();
  if (!figure.empty()) {
    std::vector<std::string_view> names;
    for (const PaperFigure& known : figures) names.push_back(known.name);
    const auto meant = nearest(figure, names);
    std::erase_if(figures, [figure](const PaperFigure& known) { return known.name != figure; });
    if (figures.empty()) {
      std::string list;
      for (const auto name : names) list += (list.empty() ? "" : ", ") + std::string(name);
      return std::unexpected{std::vector{InputError{
          "--figure", "there is no figure " + std::string(figure),
          (meant ? "perhaps " + std::string(*meant) + "; there are " : "there are ") + list}}};
    }
  } else {
    all.equations = equation_findings();
  }
  for (PaperFigure& one : figures) {
    for (const FigureRun& run : one.runs) {
      if (all.runs.contains(run.scenario)) continue;
      auto ran = run_named(run.scenario);
      if (!ran) return std::unexpected{std::move(ran.error())};
      all.runs.emplace(run.scenario, std::move(*ran));
    }
    auto findings = one.judge(all.runs);
    all.figures.push_back({std::move(one), std::move(findings)});
  }
  return all;
}

std::string reproduction_text(const Reproduction& reproduction) {
  std::string text;
  Count count{};
  if (!reproduction.equations.empty()) text += "The papers' equations\n\n";
  for (const Finding& finding : reproduction.equations) text += finding_text(finding);
  add(count, reproduction.equations);
  for (const JudgedFigure& judged : reproduction.figures) {
    text += std::string(judged.figure.paper) + ": " + std::string(judged.figure.title) + "\n\n";
    for (const Finding& finding : judged.findings) text += finding_text(finding);
    add(count, judged.findings);
  }
  return text + sentence(
                    "%d of %d statements of the papers come out; %d of %d numbers that must "
                    "come out do.\n",
                    count.agree, count.findings, count.hold, count.checks);
}

Json reproduction_json(const Reproduction& reproduction) {
  Json json{{"holds", reproduction.holds()},
            {"equations", findings_json(reproduction.equations)},
            {"figures", Json::array()}};
  for (const JudgedFigure& judged : reproduction.figures) {
    Json scenarios = Json::array();
    for (const FigureRun& run : judged.figure.runs) scenarios.push_back(run.scenario);
    json["figures"].push_back({{"name", judged.figure.name},
                               {"figure", judged.figure.paper},
                               {"title", judged.figure.title},
                               {"scenarios", std::move(scenarios)},
                               {"findings", findings_json(judged.findings)}});
  }
  return json;
}

}  // namespace cutforce::firmware::host
