// What a run tells about itself, once, for the table on a terminal, for --json, and for the report:
// figures, events, and in which files the rest is.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <variant>
#include <vector>

#include "firmware/machine.hpp"

namespace cutforce::firmware::host {

struct Figure {
  std::string key;  // for machines: "mean_sigma_nm"
  std::string name;
  std::variant<double, std::string> value;
  std::string unit = {};
  std::string note = {};
};

struct Event {
  double time_s;
  std::string text;
};

struct NamedTrace {
  std::string name;
  std::string path;  // relative to the summary
};

struct RunSummary {
  std::string title;
  std::string recording;  // relative to the summary; may be empty
  std::vector<NamedTrace> traces;
  std::vector<Figure> figures;
  std::vector<Event> events;
  std::vector<std::string> warnings;
  std::string verdict;  // one sentence
  Machine machine;
};

// As report.hpp reads it; the figures' keys and the verdict are there for other programs.
[[nodiscard]] nlohmann::ordered_json summary_json(const RunSummary& summary);

// For a terminal: the figures, aligned.
[[nodiscard]] std::string figure_text(const std::vector<Figure>& figures);

}  // namespace cutforce::firmware::host
