// A comparison in words and figures: for a terminal, and for other programs.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "firmware/host/compare/comparison.hpp"
#include "firmware/host/compare/goals.hpp"

namespace cutforce::firmware::host {

// A row a contender, then I105 by part, then the goals.
[[nodiscard]] std::string comparison_table(const Comparison& comparison,
                                           const std::vector<Goal>& goals);

// Everything: each figure of each part of each contender, totals, robustness, goals.
[[nodiscard]] nlohmann::ordered_json comparison_json(const Comparison& comparison,
                                                     const std::vector<Goal>& goals);

// One column of the summary, for tables on a terminal and on a page.
struct SummaryColumn {
  std::string head;
  std::string unit;
  std::string meaning;
};
[[nodiscard]] const std::vector<SummaryColumn>& summary_columns();
// As many texts as columns; "-" where there is nothing to say.
[[nodiscard]] std::vector<std::string> summary_of(const Comparison& comparison,
                                                  const ComparisonRow& row);

[[nodiscard]] std::string fixed(double value, int decimals);
[[nodiscard]] const char* name_of(Surroundings surroundings);

}  // namespace cutforce::firmware::host
