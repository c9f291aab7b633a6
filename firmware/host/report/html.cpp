#include "firmware/host/report/html.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace cutforce::firmware::host {
namespace {

using Json = nlohmann::ordered_json;

std::string shown(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  if (value.is_null()) return "none";
  if (value.is_number_float()) {
    const double number = value.get<double>();
    const bool whole = number == std::round(number) && std::abs(number) < 1e9;
    std::array<char, 48> text{};
    std::snprintf(text.data(), text.size(), whole ? "%.0f" : "%.4g", number);
    return text.data();
  }
  if (value.is_array()) {
    std::string text;
    for (const auto& item : value) text += (text.empty() ? "" : ", ") + shown(item);
    return text;
  }
  return value.dump(-1, ' ', true, Json::error_handler_t::replace);
}

void machine_rows(const Json& object, const std::string& prefix, std::string& out) {
  for (const auto& [key, value] : object.items()) {
    const std::string name = prefix.empty() ? key : prefix + "." + key;
    if (value.is_object())
      machine_rows(value, name, out);
    else
      out += "<tr><th scope=\"row\">" + escaped(name) + "</th><td class=\"number\">" +
             escaped(shown(value)) + "</td></tr>\n";
  }
}

}  // namespace

std::string escaped(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string script_safe(std::string_view json) {
  std::string out;
  out.reserve(json.size());
  for (const char c : json) {
    if (c == '<')
      out += "\\u003c";
    else
      out += c;
  }
  return out;
}

std::string fill(std::string_view page,
                 const std::vector<std::pair<std::string_view, std::string>>& places) {
  std::string out;
  while (true) {
    const auto open = page.find("{{");
    const auto close = open == page.npos ? page.npos : page.find("}}", open);
    if (close == page.npos) return out.append(page);
    out.append(page.substr(0, open));
    const auto name = page.substr(open + 2, close - open - 2);
    const auto found = std::find_if(places.begin(), places.end(),
                                    [&](const auto& place) { return place.first == name; });
    if (found != places.end()) out += found->second;
    page.remove_prefix(close + 2);
  }
}

std::string text_in(const Json& object, const char* key) {
  if (!object.is_object()) return {};
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string{};
}

const Json& list_in(const Json& object, const char* key) {
  static const Json kEmpty = Json::array();
  if (!object.is_object()) return kEmpty;
  const auto found = object.find(key);
  return found != object.end() && found->is_array() ? *found : kEmpty;
}

std::string figure_table(const Json& summary) {
  const Json& figures = list_in(summary, "figures");
  if (figures.empty()) return {};
  std::string out =
      "<section><h2>Figures</h2>\n<div class=\"scroll\"><table class=\"figures\">\n"
      "<thead><tr><th scope=\"col\">What</th><th scope=\"col\" class=\"number\">Value</th>"
      "<th scope=\"col\">Unit</th><th scope=\"col\">Note</th></tr></thead>\n<tbody>\n";
  for (const auto& figure : figures) {
    if (!figure.is_object()) continue;
    out += "<tr><th scope=\"row\">" + escaped(text_in(figure, "name")) +
           "</th><td class=\"number\">" +
           (figure.contains("value") ? escaped(shown(figure["value"])) : "") + "</td><td>" +
           escaped(text_in(figure, "unit")) + "</td><td class=\"note\">" +
           escaped(text_in(figure, "note")) + "</td></tr>\n";
  }
  return out + "</tbody></table></div></section>";
}

std::string event_table(const Json& summary) {
  const Json& events = list_in(summary, "events");
  if (events.empty()) return {};
  std::string out =
      "<section><h2>Events</h2>\n<div class=\"scroll\"><table class=\"events\">\n"
      "<thead><tr><th scope=\"col\">No.</th><th scope=\"col\" class=\"number\">Time, s</th>"
      "<th scope=\"col\">What happened</th></tr></thead>\n<tbody>\n";
  int number = 0;
  for (const auto& event : events) {
    if (!event.is_object() || !event.contains("t_s") || !event["t_s"].is_number()) continue;
    std::array<char, 32> time{};
    std::snprintf(time.data(), time.size(), "%.3f", event["t_s"].get<double>());
    out += "<tr><td>" + std::to_string(++number) + "</td><td class=\"number\">" + time.data() +
           "</td><td>" + escaped(text_in(event, "text")) + "</td></tr>\n";
  }
  return out + "</tbody></table></div></section>";
}

std::string machine_table(const Json& summary) {
  const auto found = summary.find("machine");
  if (found == summary.end() || !found->is_object() || found->empty()) return {};
  std::string rows;
  machine_rows(*found, "", rows);
  return "<section><details><summary>Machine parameters</summary>\n<div class=\"scroll\">"
         "<table class=\"machine\"><tbody>\n" +
         rows + "</tbody></table></div></details></section>";
}

}  // namespace cutforce::firmware::host
