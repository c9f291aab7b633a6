// The papers' experiments as scenarios, one file for each run of a figure:
// host_tests/scenarios/papers/. The program carries them, so that it reproduces anywhere.
#pragma once

#include <span>
#include <string_view>

namespace cutforce::firmware::host {

struct PaperScenario {
  std::string_view name;  // of the file, without its ending: "p1_fig08"
  std::string_view text;
};

[[nodiscard]] std::span<const PaperScenario> paper_scenarios();

}  // namespace cutforce::firmware::host
