#include "hal/linux/iio_scan.hpp"

#include <algorithm>
#include <charconv>
#include <numeric>
#include <system_error>

namespace cutforce::hal::os {
namespace {

// Takes what it reads from the front.
bool take(std::string_view& text, std::string_view start) {
  if (!text.starts_with(start)) return false;
  text.remove_prefix(start.size());
  return true;
}

bool take_number(std::string_view& text, std::uint8_t& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{}) return false;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return true;
}

bool is_sound(const ScanType& type) {
  const auto stored = type.stored_bits;
  const bool whole = stored == 8 || stored == 16 || stored == 32 || stored == 64;
  return whole && type.repeat >= 1 && type.used_bits >= 1 &&
         unsigned{type.used_bits} + type.shift <= stored;
}

}  // namespace

std::optional<ScanType> parse_scan_type(std::string_view text) noexcept {
  ScanType type{.big_endian = false,
                .is_signed = false,
                .used_bits = 0,
                .stored_bits = 0,
                .repeat = 1,
                .shift = 0};
  if (take(text, "be:")) {
    type.big_endian = true;
  } else if (!take(text, "le:")) {
    return std::nullopt;
  }
  if (take(text, "s")) {
    type.is_signed = true;
  } else if (!take(text, "u")) {
    return std::nullopt;
  }
  if (!take_number(text, type.used_bits) || !take(text, "/") ||
      !take_number(text, type.stored_bits)) {
    return std::nullopt;
  }
  if (take(text, "X") && !take_number(text, type.repeat)) return std::nullopt;
  if (take(text, ">>") && !take_number(text, type.shift)) return std::nullopt;
  take(text, "\n");
  if (!text.empty() || !is_sound(type)) return std::nullopt;
  return type;
}

ScanLayout lay_out(std::span<const ScanElement> elements) {
  std::vector<std::size_t> order(elements.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t i) { return elements[i].index; });
  ScanLayout layout{.offsets = std::vector<std::size_t>(elements.size()), .bytes = 0};
  std::size_t largest = 1;
  const auto align = [&](std::size_t to) { layout.bytes = (layout.bytes + to - 1) / to * to; };
  for (const auto i : order) {
    const auto size = elements[i].type.bytes();
    align(size);
    layout.offsets[i] = layout.bytes;
    layout.bytes += size;
    largest = std::max(largest, size);
  }
  align(largest);
  return layout;
}

std::int64_t read_element(std::span<const std::byte> bytes, const ScanType& type) noexcept {
  const std::size_t size = std::size_t{type.stored_bits} / 8;
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const auto next = type.big_endian ? bytes[i] : bytes[size - 1 - i];
    value = value << 8U | std::to_integer<std::uint64_t>(next);
  }
  // Up to the top, and back: drops what is above the used bits and brings the sign down.
  const unsigned above = 64U - type.used_bits;
  value = value >> type.shift << above;
  return type.is_signed ? static_cast<std::int64_t>(value) >> above
                        : static_cast<std::int64_t>(value >> above);
}

std::uint32_t missing_between(std::int64_t before_ns, std::int64_t now_ns,
                              std::int64_t period_ns) noexcept {
  const auto gap_ns = now_ns - before_ns;
  if (period_ns <= 0 || gap_ns <= period_ns + period_ns / 2) return 0;
  const auto periods =
      (gap_ns - period_ns) / period_ns + ((gap_ns - period_ns) % period_ns > period_ns / 2 ? 1 : 0);
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(periods, 1, UINT32_MAX));
}

}  // namespace cutforce::hal::os
