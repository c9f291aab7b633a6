// The byte on the eight override lines of a CNC, in five codes (equation (C12), tables in
// OVERRIDE_CODES.md, which a test checks against this file).
//
//   binary          byte = percent, 0..255
//   fanuc_fv        byte = ~percent, 0..254: eight active-low lines *FV0..*FV7 of 1, 2, .. 128 %.
//                   All lines 1 is 0 %, and all lines 0 is 0 % too, not 255 %: byte 0x00 would
//                   stop the feed where more feed was wanted, so it is never sent.
//   fanuc_ov_10     low four bits = ~(percent / 10): *OV1..*OV8 of 10, 20, 40, 80 %, 0..150 %;
//                   the upper four lines rest at 1
//   siemens_gray    byte = percent ^ percent / 2, 0..200: reflected Gray code, one line moves a
//   point siemens_binary  byte = percent, 0..200
//
// What a code cannot say is rounded down, never up: nobody gets more feed than was asked for.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace cutforce::control {

enum class OverrideCode : std::uint8_t {
  kBinary,
  kFanucFv,
  kFanucOv10,
  kSiemensGray,
  kSiemensBinary,
};
inline constexpr std::size_t kOverrideCodeCount = 5;

inline constexpr std::array<std::string_view, kOverrideCodeCount> kOverrideCodeNames{
    "binary", "fanuc_fv", "fanuc_ov_10", "siemens_gray", "siemens_binary"};

// Highest percentage that the code can say.
[[nodiscard]] constexpr std::uint8_t highest_pct(OverrideCode code) noexcept {
  constexpr std::array<std::uint8_t, kOverrideCodeCount> kHighest{255, 254, 150, 200, 200};
  return kHighest[static_cast<std::size_t>(code)];
}

// Distance of neighbouring percentages that the code can say.
[[nodiscard]] constexpr std::uint8_t step_pct(OverrideCode code) noexcept {
  return code == OverrideCode::kFanucOv10 ? 10 : 1;
}

// The byte for `percent`, or for the highest percentage below it that the code can say. (C12)
[[nodiscard]] constexpr std::uint8_t encode(OverrideCode code, std::uint8_t percent) noexcept {
  if (code == OverrideCode::kBinary) return percent;  // it can say everything
  const unsigned value = std::min(percent, highest_pct(code));
  switch (code) {
    case OverrideCode::kBinary:
    case OverrideCode::kSiemensBinary:
      return static_cast<std::uint8_t>(value);
    case OverrideCode::kFanucFv:
      return static_cast<std::uint8_t>(~value);
    case OverrideCode::kFanucOv10:
      return static_cast<std::uint8_t>(~(value / 10U));
    case OverrideCode::kSiemensGray:
      return static_cast<std::uint8_t>(value ^ value >> 1U);
  }
  return 0;
}

// The percentage that the CNC takes from `byte`; nothing iff the code does not define the byte
// (siemens_*: above 200 %). fanuc_ov_10 looks at its four lines only.
[[nodiscard]] constexpr std::optional<std::uint8_t> decode(OverrideCode code,
                                                           std::uint8_t byte) noexcept {
  unsigned value = byte;
  switch (code) {
    case OverrideCode::kBinary:
    case OverrideCode::kSiemensBinary:
      break;
    case OverrideCode::kFanucFv:
      value = byte == 0 ? 0U : ~value & 0xFFU;
      break;
    case OverrideCode::kFanucOv10:
      value = 10U * (~value & 0xFU);
      break;
    case OverrideCode::kSiemensGray:
      value ^= value >> 4U;
      value ^= value >> 2U;
      value ^= value >> 1U;
      break;
  }
  if (value > highest_pct(code)) return std::nullopt;
  return static_cast<std::uint8_t>(value);
}

}  // namespace cutforce::control
