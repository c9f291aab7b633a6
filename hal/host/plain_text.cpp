#include "hal/host/plain_text.hpp"

#include <algorithm>

namespace cutforce::hal::host {
namespace {

// Length of the UTF-8 sequence at the front, or 0: no overlong forms, no surrogates, RFC 3629, 4.
std::size_t sequence_length(std::string_view bytes) noexcept {
  const auto byte = [bytes](std::size_t i) -> unsigned {
    return i < bytes.size() ? static_cast<unsigned char>(bytes[i]) : 0U;
  };
  const auto tail = [&byte](std::size_t i) { return (byte(i) & 0xC0U) == 0x80U; };
  const unsigned first = byte(0);
  if (first < 0x80U) return first >= 0x20U ? (first != 0x7FU ? 1 : 0) : (first == '\t' ? 1 : 0);
  if (first >= 0xC2U && first <= 0xDFU) return tail(1) ? 2 : 0;
  if (first >= 0xE0U && first <= 0xEFU) {
    const bool low = first == 0xE0U && byte(1) < 0xA0U;
    const bool surrogate = first == 0xEDU && byte(1) > 0x9FU;
    return tail(1) && tail(2) && !low && !surrogate ? 3 : 0;
  }
  if (first >= 0xF0U && first <= 0xF4U) {
    const bool low = first == 0xF0U && byte(1) < 0x90U;
    const bool high = first == 0xF4U && byte(1) > 0x8FU;
    return tail(1) && tail(2) && tail(3) && !low && !high ? 4 : 0;
  }
  return 0;
}

}  // namespace

std::size_t find_non_text(std::string_view bytes) noexcept {
  for (std::size_t i = 0; i < bytes.size();) {
    const std::size_t length = sequence_length(bytes.substr(i, 4));
    if (length == 0) return i;
    i += length;
  }
  return std::string_view::npos;
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t kMaxQuoted = 40;
  const std::string_view sound = text.substr(0, std::min(text.size(), find_non_text(text)));
  if (sound.size() <= kMaxQuoted) return "'" + std::string(sound) + "'";
  std::size_t length = kMaxQuoted;
  while ((static_cast<unsigned char>(sound[length]) & 0xC0U) == 0x80U)
    --length;  // whole characters
  return "'" + std::string(sound.substr(0, length)) + "...'";
}

std::string_view trimmed(std::string_view text) noexcept {
  constexpr std::string_view kSpace = " \t\r";
  const std::size_t first = text.find_first_not_of(kSpace);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kSpace) - first + 1);
}

}  // namespace cutforce::hal::host
