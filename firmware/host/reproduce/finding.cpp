#include "firmware/host/reproduce/finding.hpp"

#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>

namespace cutforce::firmware::host {

std::string sentence(const char* format, ...) {
  std::array<char, 1024> text{};
  va_list values;
  va_start(values, format);
  std::vsnprintf(text.data(), text.size(), format, values);
  va_end(values);
  return text.data();
}

std::string seconds_or_never(double seconds) {
  return std::isfinite(seconds) ? sentence("%.2f s", seconds) : "never";
}

std::vector<PaperFigure> paper_figures() {
  std::vector<PaperFigure> figures;
  for (const auto of_paper : {&pole_assignment_figures, &end_mill_figures, &turning_figures}) {
    for (PaperFigure& figure : of_paper()) figures.push_back(std::move(figure));
  }
  return figures;
}

}  // namespace cutforce::firmware::host
