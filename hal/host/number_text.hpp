// Numbers of a CSV cell, and back. Decimal text only, independent of the locale, no NaN and no
// infinity. Time becomes whole nanoseconds by decimal arithmetic, because 0.000050 s is 50000 ns
// and its nearest double times 1e9 need not be.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <string_view>
#include <system_error>

namespace cutforce::hal::host {

enum class CellState : std::uint8_t {
  kValue,
  kEmpty,
  kNotANumber,
  kNotFinite,   // the text says NaN or infinity
  kOutOfRange,  // a number, but too large for its type
};

template <class T>
struct Cell {
  T value;
  CellState state;
  const char* end;  // the comma after the cell, or the end of the row
};

// Differences of two times must fit 64 bits, hence half of what a time itself could be: 146 years.
inline constexpr std::int64_t kMaxTimeNs = INT64_MAX / 2;

template <class T>
[[nodiscard]] Cell<T> read_unusual_number(const char* begin, const char* end) noexcept;
[[nodiscard]] Cell<std::int64_t> read_unusual_time(const char* begin, const char* end) noexcept;

// The cell that starts at `begin` in a row that ends at `end`; spaces around it and a plus sign are
// accepted. T is float or double.
template <class T>
[[nodiscard]] inline Cell<T> read_number(const char* begin, const char* end) noexcept {
  T value{};
  const auto [stop, error] = std::from_chars(begin, end, value);
  if (error == std::errc{} && (stop == end || *stop == ',') && std::isfinite(value)) {
    return {.value = value, .state = CellState::kValue, .end = stop};
  }
  return read_unusual_number<T>(begin, end);
}

// Seconds in text, nanoseconds out; below a nanosecond rounded to nearest.
[[nodiscard]] inline Cell<std::int64_t> read_time(const char* begin, const char* end) noexcept {
  constexpr int kMaxWhole = 9;
  constexpr int kDecimals = 9;
  const char* at = begin;
  std::int64_t ns = 0;
  for (; at != end && *at >= '0' && *at <= '9'; ++at) {
    if (at - begin == kMaxWhole) return read_unusual_time(begin, end);
    ns = ns * 10 + (*at - '0');
  }
  if (at == begin) return read_unusual_time(begin, end);
  int decimals = 0;
  if (at != end && *at == '.') {
    for (++at; at != end && *at >= '0' && *at <= '9'; ++at, ++decimals) {
      if (decimals == kDecimals) return read_unusual_time(begin, end);
      ns = ns * 10 + (*at - '0');
    }
  }
  if (at != end && *at != ',') return read_unusual_time(begin, end);
  for (; decimals < kDecimals; ++decimals) ns *= 10;
  return {.value = ns, .state = CellState::kValue, .end = at};
}

// What is wrong with a cell, as a sentence without a full stop; and what would be right.
[[nodiscard]] std::string_view describe(CellState state) noexcept;

inline constexpr int kMaxNumberChars = 32;

// Seconds with six decimals where that is exact, else nine. Writes at most kMaxNumberChars and
// returns the end.
[[nodiscard]] char* write_time(char* out, std::int64_t time_ns) noexcept;

// The shortest text that reads back as the same value. `value` is finite.
[[nodiscard]] char* write_number(char* out, float value) noexcept;
[[nodiscard]] char* write_number(char* out, double value) noexcept;

}  // namespace cutforce::hal::host
