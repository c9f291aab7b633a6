// All figures of the papers, run and judged: for a terminal, for programs, and as one page.
#pragma once

#include <expected>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/host/reproduce/finding.hpp"

namespace cutforce::firmware::host {

struct JudgedFigure {
  PaperFigure figure;
  std::vector<Finding> findings;
};

struct Reproduction {
  Runs runs;
  std::vector<Finding> equations;  // empty where one figure was asked for
  std::vector<JudgedFigure> figures;

  [[nodiscard]] bool holds() const;  // every check
};

// `figure`: one alone, or all where it is empty. Fails iff there is no such figure, or a scenario
// is refused. Throws Stopped.
[[nodiscard]] std::expected<Reproduction, std::vector<InputError>> reproduce(
    std::string_view figure);

[[nodiscard]] std::string reproduction_text(const Reproduction& reproduction);
[[nodiscard]] nlohmann::ordered_json reproduction_json(const Reproduction& reproduction);
// One self-contained page.
[[nodiscard]] std::string reproduction_page(const Reproduction& reproduction);

}  // namespace cutforce::firmware::host
