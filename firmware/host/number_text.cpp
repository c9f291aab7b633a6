#include "firmware/host/number_text.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>

namespace cutforce::firmware::host {
namespace {

template <class Number>
std::string shortest(Number value) {
  const auto size = std::fabs(value);
  const bool plain = size == Number{0} || (size >= Number(1e-4) && size < Number(1e7));
  std::array<char, 64> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value,
                                 plain ? std::chars_format::fixed : std::chars_format::scientific);
  std::string result(text.data(), end.ptr);
  // 1e-06 and 1e+07 are legal but ugly.
  if (const auto e = result.find('e'); e != std::string::npos) {
    std::size_t digits = e + 1;
    if (result[digits] == '-') ++digits;
    if (result[digits] == '+') result.erase(digits, 1);
    while (digits + 1 < result.size() && result[digits] == '0') result.erase(digits, 1);
  }
  return result;
}

}  // namespace

std::string number_text(float value) {
  std::string text = shortest(value);
  // A reader may round twice, to double and to float; a text beside a midpoint would then miss.
  if (static_cast<float>(std::strtod(text.c_str(), nullptr)) != value) {
    text = shortest(static_cast<double>(value));
  }
  return text;
}

}  // namespace cutforce::firmware::host
