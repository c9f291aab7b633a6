#include "hal/cortex_m/console.hpp"

#include <array>
#include <cstddef>

namespace cutforce::hal::cortex_m::console {

void write_number(std::uint32_t value) noexcept {
  std::array<char, 10> digits{};
  std::size_t at = digits.size();
  do {
    digits[--at] = static_cast<char>('0' + value % 10U);
    value /= 10U;
  } while (value != 0);
  write({digits.data() + at, digits.size() - at});
}

void write_hexadecimal(std::uint64_t value) noexcept {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::array<char, 16> text{};
  for (std::size_t k = 0; k < text.size(); ++k) {
    text[text.size() - 1 - k] = kDigits[static_cast<std::size_t>(value >> (4 * k)) & 0xFU];
  }
  write({text.data(), text.size()});
}

}  // namespace cutforce::hal::cortex_m::console
