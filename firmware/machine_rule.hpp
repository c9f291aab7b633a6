// One thing that must hold between parameters.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "firmware/parameter_table.hpp"

namespace cutforce::firmware {

struct MachineRule {
  std::array<std::string_view, 4> keys;  // of the parameters it speaks of; the first is to blame
  bool (*holds)(const Machine&) noexcept;
  std::string_view what;
  std::string_view remedy;
};

namespace detail {

// a is n times b, n = 1, 2, ...; to the precision of a period written with few decimals.
[[nodiscard]] constexpr bool is_multiple(float a, float b) noexcept {
  const float ratio = a / b;
  if (!(ratio > 0.5F && ratio < 1e6F)) return false;
  const float nearest = static_cast<float>(static_cast<std::int32_t>(ratio + 0.5F));
  const float error = ratio - nearest;
  return error < 1e-3F && error > -1e-3F;
}

}  // namespace detail
}  // namespace cutforce::firmware
