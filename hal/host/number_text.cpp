#include "hal/host/number_text.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <concepts>
#include <cstddef>
#include <cstring>

#include "hal/host/plain_text.hpp"

namespace cutforce::hal::host {
namespace {

constexpr bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }

const char* cell_end(const char* begin, const char* end) noexcept {
  return std::find(begin, end, ',');
}

// Spaces off; one plus sign off, unless another sign follows.
std::string_view bare_number(const char* begin, const char* end) noexcept {
  std::string_view text = trimmed({begin, static_cast<std::size_t>(end - begin)});
  if (text.size() > 1 && text[0] == '+' && (is_digit(text[1]) || text[1] == '.')) {
    text.remove_prefix(1);
  }
  return text;
}

constexpr int kMaxDigits = 19;  // any 19 digits fit 64 bits
constexpr auto kPowersOfTen = [] {
  std::array<std::uint64_t, kMaxDigits + 1> powers{};
  std::uint64_t power = 1;
  for (auto& entry : powers) {
    entry = power;
    power *= 10;
  }
  return powers;
}();

// digits * 10^exponent, as read; digits past the nineteenth only count.
struct Decimal {
  std::uint64_t digits = 0;
  int count = 0;
  std::int64_t exponent = 0;
  bool negative = false;

  void push(char c, bool fraction) noexcept {
    if (count == kMaxDigits) {
      exponent += fraction ? 0 : 1;
      return;
    }
    digits = digits * 10 + static_cast<std::uint64_t>(c - '0');
    if (digits != 0) ++count;  // leading zeros carry nothing
    exponent -= fraction ? 1 : 0;
  }
};

// Fails, with null, unless the whole text is one decimal number.
const char* read_mantissa(const char* at, const char* end, Decimal& decimal) noexcept {
  if (at != end && *at == '-') {
    decimal.negative = true;
    ++at;
  }
  bool any = false;
  for (; at != end && is_digit(*at); ++at, any = true) decimal.push(*at, false);
  if (at != end && *at == '.') {
    for (++at; at != end && is_digit(*at); ++at, any = true) decimal.push(*at, true);
  }
  return any ? at : nullptr;
}

CellState read_decimal(std::string_view text, Decimal& decimal) noexcept {
  const char* const end = text.data() + text.size();
  const char* at = read_mantissa(text.data(), end, decimal);
  if (at == nullptr) return CellState::kNotANumber;
  if (at == end) return CellState::kValue;
  if (*at != 'e' && *at != 'E') return CellState::kNotANumber;
  ++at;
  if (end - at > 1 && *at == '+' && is_digit(at[1])) ++at;
  int exponent = 0;
  const auto [stop, error] = std::from_chars(at, end, exponent);
  if (error == std::errc::result_out_of_range) return CellState::kOutOfRange;
  if (error != std::errc{} || stop != end) return CellState::kNotANumber;
  decimal.exponent += exponent;
  return CellState::kValue;
}

// digits * 10^power, rounded to nearest; kMaxTimeNs + 1 where it is larger than kMaxTimeNs.
std::uint64_t scaled(std::uint64_t digits, std::int64_t power) noexcept {
  constexpr auto kMax = static_cast<std::uint64_t>(kMaxTimeNs);
  if (digits == 0) return 0;
  if (power > kMaxDigits) return kMax + 1;
  if (power < -kMaxDigits) return 0;
  if (power >= 0) {
    const std::uint64_t factor = kPowersOfTen[static_cast<std::size_t>(power)];
    return digits > kMax / factor ? kMax + 1 : digits * factor;
  }
  const std::uint64_t divisor = kPowersOfTen[static_cast<std::size_t>(-power)];
  const std::uint64_t remainder = digits % divisor;
  return std::min(kMax + 1, digits / divisor + (remainder >= divisor - remainder ? 1 : 0));
}

bool says_not_finite(std::string_view text) noexcept {
  if (!text.empty() && (text[0] == '+' || text[0] == '-')) text.remove_prefix(1);
  const auto starts_with = [text](std::string_view word) {
    return text.size() >= word.size() &&
           std::equal(word.begin(), word.end(), text.begin(), [](char a, char b) {
             return a == static_cast<char>(std::tolower(static_cast<unsigned char>(b)));
           });
  };
  return starts_with("nan") || starts_with("inf");
}

}  // namespace

template <class T>
Cell<T> read_unusual_number(const char* begin, const char* end) noexcept {
  const char* const stop_at = cell_end(begin, end);
  Cell<T> cell{.value = T{}, .state = CellState::kEmpty, .end = stop_at};
  const std::string_view text = bare_number(begin, stop_at);
  if (text.empty()) return cell;
  const char* const text_end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), text_end, cell.value);
  if (says_not_finite(text)) {
    cell.state = CellState::kNotFinite;
  } else if (error == std::errc::invalid_argument || stop != text_end) {
    cell.state = CellState::kNotANumber;
  } else if (error == std::errc::result_out_of_range || !std::isfinite(cell.value)) {
    // from_chars says the same of what is too small; too small is zero and no fault.
    Decimal decimal;
    const CellState read = read_decimal(text, decimal);
    const bool small = read == CellState::kValue && decimal.exponent + decimal.count <= 0;
    cell.value = T{};
    cell.state = small ? CellState::kValue : CellState::kOutOfRange;
  } else {
    cell.state = CellState::kValue;
  }
  return cell;
}

template Cell<float> read_unusual_number<float>(const char*, const char*) noexcept;
template Cell<double> read_unusual_number<double>(const char*, const char*) noexcept;

Cell<std::int64_t> read_unusual_time(const char* begin, const char* end) noexcept {
  constexpr std::int64_t kNanoPower = 9;
  const char* const stop_at = cell_end(begin, end);
  Cell<std::int64_t> cell{.value = 0, .state = CellState::kEmpty, .end = stop_at};
  const std::string_view text = bare_number(begin, stop_at);
  if (text.empty()) return cell;
  if (says_not_finite(text)) {
    cell.state = CellState::kNotFinite;
    return cell;
  }
  Decimal decimal;
  cell.state = read_decimal(text, decimal);
  if (cell.state != CellState::kValue) return cell;
  const std::uint64_t magnitude = scaled(decimal.digits, decimal.exponent + kNanoPower);
  if (magnitude > static_cast<std::uint64_t>(kMaxTimeNs)) {
    cell.state = CellState::kOutOfRange;
    return cell;
  }
  const auto value = static_cast<std::int64_t>(magnitude);
  cell.value = decimal.negative ? -value : value;
  return cell;
}

std::string_view describe(CellState state) noexcept {
  switch (state) {
    case CellState::kValue:
      return "is a number";
    case CellState::kEmpty:
      return "is empty";
    case CellState::kNotANumber:
      return "is not a number";
    case CellState::kNotFinite:
      return "is not a finite number";
    case CellState::kOutOfRange:
      return "is out of range";
  }
  return "";
}

char* write_time(char* out, std::int64_t time_ns) noexcept {
  constexpr std::uint64_t kNsPerSecond = 1'000'000'000;
  constexpr std::uint64_t kNsPerMicrosecond = 1'000;
  std::uint64_t magnitude = static_cast<std::uint64_t>(time_ns);
  if (time_ns < 0) {
    *out++ = '-';
    magnitude = 0 - magnitude;
  }
  out = std::to_chars(out, out + kMaxNumberChars - 1, magnitude / kNsPerSecond).ptr;
  *out++ = '.';
  std::uint64_t fraction = magnitude % kNsPerSecond;
  int digits = 9;
  if (fraction % kNsPerMicrosecond == 0) {
    fraction /= kNsPerMicrosecond;
    digits = 6;
  }
  for (int i = digits; i-- > 0; fraction /= 10) out[i] = static_cast<char>('0' + fraction % 10);
  return out + digits;
}

char* write_number(char* out, float value) noexcept {
  return std::to_chars(out, out + kMaxNumberChars, value).ptr;
}

char* write_number(char* out, double value) noexcept {
  return std::to_chars(out, out + kMaxNumberChars, value).ptr;
}

}  // namespace cutforce::hal::host
