// Any float at all, NaN, infinities and denormals included.
#pragma once

#include <bit>
#include <cstdint>
#include <random>

namespace cutforce::host_tests {

[[nodiscard]] inline float any_float(std::mt19937& random) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(random()));
}

}  // namespace cutforce::host_tests
