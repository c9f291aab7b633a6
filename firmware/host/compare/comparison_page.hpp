// A comparison as one self-contained HTML page: tables, and force and override over time of every
// contender on every part. It opens without a network.
#pragma once

#include <string>
#include <vector>

#include "firmware/host/compare/comparison.hpp"
#include "firmware/host/compare/goals.hpp"

namespace cutforce::firmware::host {

// Of a comparison with traces; those are of the first seed.
[[nodiscard]] std::string comparison_page(const Comparison& comparison,
                                          const std::vector<Goal>& goals);

}  // namespace cutforce::firmware::host
