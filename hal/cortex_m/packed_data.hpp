// The first values of the variables, as toolchain/cortex_m/pack_data.py left them in flash: a board
// is made by the compiler, and most of it is zeros and numbers that come more than once.
//
//   0nnnnnnn                     n + 1 words follow, as they are
//   10nnnnnn dddddddd            the n + 1 words that begin d words back, once more
//   11nnnnnn dddddddd dddddddd   likewise, further back; low byte first
#pragma once

#include <cstdint>

namespace cutforce::hal::cortex_m {

// Fills the words from `out` to `end`, which is where the packed ones end too.
constexpr void unpack(const std::uint8_t* packed, std::uint32_t* out,
                      const std::uint32_t* end) noexcept {
  while (out < end) {
    const std::uint32_t token = *packed++;
    if ((token & 0x80U) == 0) {
      for (std::uint32_t left = token + 1; left > 0; --left) {
        std::uint32_t word = 0;
        for (std::uint32_t shift = 0; shift < 32; shift += 8) {
          word |= std::uint32_t{*packed++} << shift;
        }
        *out++ = word;
      }
      continue;
    }
    std::uint32_t back = *packed++;
    if ((token & 0x40U) != 0) back |= std::uint32_t{*packed++} << 8U;
    const std::uint32_t* from = out - back;
    for (std::uint32_t left = (token & 0x3FU) + 1; left > 0; --left) *out++ = *from++;
  }
}

}  // namespace cutforce::hal::cortex_m
