// What the numbers in the board's frames are called; a frame may say what this program does not
// know yet.
#pragma once

#include <cstdint>
#include <string_view>

#include "control/supervisor_text.hpp"

namespace cutforce::firmware::host {

[[nodiscard]] constexpr std::string_view board_state_name(std::uint8_t state) noexcept {
  return state < control::kStateTexts.size() ? control::kStateTexts[state].name : "unknown";
}
[[nodiscard]] constexpr std::string_view reason_name(std::uint8_t reason) noexcept {
  return reason < control::kReasonTexts.size() ? control::kReasonTexts[reason].name : "unknown";
}

}  // namespace cutforce::firmware::host
