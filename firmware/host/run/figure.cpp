#include "firmware/host/run/figure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "firmware/parameter_table.hpp"

namespace cutforce::firmware::host {
namespace {

using Json = nlohmann::ordered_json;

// Characters, not bytes: a figure's unit may hold one that takes two.
std::size_t width(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

std::string shown(const std::variant<double, std::string>& value) {
  if (const auto* text = std::get_if<std::string>(&value)) return *text;
  std::array<char, 32> text{};
  const double number = std::get<double>(value);
  const bool whole = number == std::round(number) && std::abs(number) < 1e9;
  const char* format = whole ? "%.0f" : std::abs(number) < 100.0 ? "%.3g" : "%.4g";
  std::snprintf(text.data(), text.size(), format, number);
  return text.data();
}

Json json_of(const Parameter& parameter, const Machine& machine) {
  const float first = parameter.get(machine, 0);
  switch (parameter.kind) {
    case Kind::kNumber:
    case Kind::kWhole:
      return first;
    case Kind::kTriple:
      return {first, parameter.get(machine, 1), parameter.get(machine, 2)};
    case Kind::kFlag:
      return first != 0.0F;
    case Kind::kChoice:
      return parameter.names[static_cast<std::size_t>(first)];
  }
  return nullptr;
}

}  // namespace

Json summary_json(const RunSummary& summary) {
  Json json{{"title", summary.title}};
  if (!summary.verdict.empty()) json["verdict"] = summary.verdict;
  if (!summary.recording.empty()) json["recording"] = summary.recording;
  json["traces"] = Json::array();
  for (const auto& trace : summary.traces) {
    json["traces"].push_back({{"name", trace.name}, {"path", trace.path}});
  }
  json["figures"] = Json::array();
  for (const auto& figure : summary.figures) {
    Json entry{{"key", figure.key}, {"name", figure.name}};
    std::visit([&](const auto& value) { entry["value"] = value; }, figure.value);
    if (!figure.unit.empty()) entry["unit"] = figure.unit;
    if (!figure.note.empty()) entry["note"] = figure.note;
    json["figures"].push_back(std::move(entry));
  }
  json["events"] = Json::array();
  for (const auto& event : summary.events) {
    json["events"].push_back({{"t_s", event.time_s}, {"text", event.text}});
  }
  json["warnings"] = summary.warnings;
  json["machine"] = Json::object();
  for (const Parameter& parameter : kParameters) {
    json["machine"][std::string(name_of(parameter.section))][std::string(parameter.key)] =
        json_of(parameter, summary.machine);
  }
  return json;
}

std::string figure_text(const std::vector<Figure>& figures) {
  std::size_t name_width = 0;
  std::size_t value_width = 0;
  std::size_t unit_width = 0;
  for (const Figure& figure : figures) {
    name_width = std::max(name_width, width(figure.name));
    unit_width = std::max(unit_width, width(figure.unit));
    // A text is not a number to be aligned with others.
    if (std::holds_alternative<double>(figure.value)) {
      value_width = std::max(value_width, width(shown(figure.value)));
    }
  }
  std::string text;
  for (const Figure& figure : figures) {
    const std::string value = shown(figure.value);
    std::string line = "  " + figure.name + std::string(name_width - width(figure.name) + 2, ' ');
    const bool number = std::holds_alternative<double>(figure.value);
    if (number) line += std::string(value_width - width(value), ' ');
    line += value;
    if (number || !figure.unit.empty()) {
      line += " " + figure.unit + std::string(unit_width - width(figure.unit), ' ');
    }
    if (!figure.note.empty()) line += "  " + figure.note;
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

}  // namespace cutforce::firmware::host
