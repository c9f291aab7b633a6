// What a paper says of a figure, what the run of it gives, and whether the two agree.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/host/reproduce/closed_loop.hpp"

namespace cutforce::firmware::host {

// A number that must come out: the project's corrected sheet of the papers, 1.4.
struct Check {
  std::string name;
  double value;
  double least;
  double most;

  // False for NaN.
  [[nodiscard]] bool holds() const noexcept { return value >= least && value <= most; }
};

enum class Outcome : std::uint8_t {
  kAgrees,
  kDiffers,
  kBeside,  // the paper says nothing of it
};

struct Finding {
  std::string said;  // by the paper, in words; beside it: what was tried
  std::string got;   // here, in numbers
  Outcome outcome;
  std::string reason;  // where they differ, why; or what else there is to know
  std::vector<Check> checks{};
};

// By the scenario's name.
using Runs = std::map<std::string, ClosedLoop, std::less<>>;

// One curve of a figure.
struct FigureRun {
  std::string_view scenario;
  std::string_view label;
};

struct PaperFigure {
  std::string_view name;   // "p1_fig08"
  std::string_view paper;  // "P1 Fig. 8"
  std::string_view title;
  std::vector<FigureRun> runs;
  std::vector<Finding> (*judge)(const Runs& runs);
};

// In the order of the papers.
[[nodiscard]] std::vector<PaperFigure> paper_figures();

// What needs no run: the papers' equations, evaluated.
[[nodiscard]] std::vector<Finding> equation_findings();

[[nodiscard]] constexpr std::string_view name_of(Outcome outcome) noexcept {
  constexpr std::string_view kNames[] = {"agrees", "differs", "beside"};
  return kNames[static_cast<std::size_t>(outcome)];
}
[[nodiscard]] constexpr Outcome agrees_if(bool holds) noexcept {
  return holds ? Outcome::kAgrees : Outcome::kDiffers;
}

// Of each paper, for paper_figures().
[[nodiscard]] std::vector<PaperFigure> pole_assignment_figures();  // P1
[[nodiscard]] std::vector<PaperFigure> end_mill_figures();         // P2
[[nodiscard]] std::vector<PaperFigure> turning_figures();          // P3

// printf's format, as a string.
[[nodiscard]] std::string sentence(const char* format, ...) __attribute__((format(printf, 1, 2)));
// "0.70 s", or "never".
[[nodiscard]] std::string seconds_or_never(double seconds);

}  // namespace cutforce::firmware::host
