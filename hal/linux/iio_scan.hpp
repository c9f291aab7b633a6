// How the samples of a Linux IIO device lie in memory. Pure: text and bytes in, numbers out.
//
// A channel's type is one line of text, e.g. le:s12/16>>4: byte order, sign, used bits / stored
// bits, X and a repeat if above 1, shift. value = (stored >> shift), its lowest used bits,
// sign-extended for s. A scan holds the enabled channels in order of their index; each lies at a
// multiple of its own size, and the scan's size is a multiple of the largest (the kernel's
// iio_compute_scan_bytes). Documentation/ABI/testing/sysfs-bus-iio, *_type.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace cutforce::hal::os {

struct ScanType {
  bool big_endian;
  bool is_signed;
  std::uint8_t used_bits;
  std::uint8_t stored_bits;  // 8, 16, 32 or 64
  std::uint8_t repeat;       // 1: a plain number
  std::uint8_t shift;

  [[nodiscard]] constexpr std::size_t bytes() const noexcept {
    return std::size_t{stored_bits} / 8 * repeat;
  }
  friend constexpr bool operator==(const ScanType&, const ScanType&) noexcept = default;
};

// Fails iff the text is not a type, or says more bits than it stores. A line end after it is fine.
[[nodiscard]] std::optional<ScanType> parse_scan_type(std::string_view text) noexcept;

struct ScanElement {
  unsigned index;
  ScanType type;
};

struct ScanLayout {
  std::vector<std::size_t> offsets;  // of each element, in the order they were given
  std::size_t bytes;
};
// Any order of elements; their indices differ.
[[nodiscard]] ScanLayout lay_out(std::span<const ScanElement> elements);

// The number at the front of `bytes`, which holds at least type.bytes(). repeat is 1. An unsigned
// number of 64 used bits beyond 2^63-1 comes out negative: there is no such converter.
[[nodiscard]] std::int64_t read_element(std::span<const std::byte> bytes,
                                        const ScanType& type) noexcept;

// SI = (stored + offset) * factor
struct Conversion {
  double offset;
  double factor;

  [[nodiscard]] constexpr float si(std::int64_t stored) const noexcept {
    return static_cast<float>((static_cast<double>(stored) + offset) * factor);
  }
};

// Samples missing between two that follow each other: none up to 1.5 periods, else the whole
// periods between them less one. 0 where time stands or goes back.
[[nodiscard]] std::uint32_t missing_between(std::int64_t before_ns, std::int64_t now_ns,
                                            std::int64_t period_ns) noexcept;

}  // namespace cutforce::hal::os
