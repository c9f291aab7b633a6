#include "firmware/host/design/design_text.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "firmware/host/number_text.hpp"

namespace cutforce::firmware::host {

double rounded(double value) {
  if (value == 0.0) return 0.0;
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g", value);
  return std::strtod(text.data(), nullptr);
}

std::string number(double value) { return number_text(static_cast<float>(value)); }

std::string brief(double value) {
  if (std::isinf(value)) return "none";
  return number(rounded(value));
}

std::string margin_text(const Margins& margins) {
  if (!margins.stable) return "not stable";
  const auto or_any = [](double value, const std::string& text) {
    return std::isinf(value) ? std::string("any") : text;
  };
  const double degrees = margins.phase_rad * 180.0 / std::numbers::pi;
  return "gain x" + or_any(margins.gain_ratio, brief(margins.gain_ratio)) + ", phase " +
         or_any(degrees, brief(degrees) + " deg") + ", delay " +
         or_any(margins.delay_s, brief(margins.delay_s) + " s") + ", modulus " +
         brief(margins.modulus_ratio);
}

}  // namespace cutforce::firmware::host
