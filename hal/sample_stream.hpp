// A recording as a small target reads it: a header, the machine's parameters as they lie in memory,
// and samples as they lie in memory, little endian. Not a format to keep: it goes with the build
// that wrote it, and the header refuses another's.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <type_traits>

#include "hal/port.hpp"

namespace cutforce::hal {

struct SampleStreamHeader {
  std::array<char, 8> magic;
  std::uint32_t machine_bytes;  // of the parameters that follow
  std::uint32_t sample_bytes;   // of each sample
  std::uint64_t samples;

  [[nodiscard]] static constexpr SampleStreamHeader of(std::uint32_t machine_bytes,
                                                       std::uint64_t samples) noexcept {
    return {.magic = {'c', 'u', 't', 'f', 'o', 'r', 'c', '1'},
            .machine_bytes = machine_bytes,
            .sample_bytes = sizeof(Sample),
            .samples = samples};
  }
  // Whether this build can read it.
  [[nodiscard]] constexpr bool fits(std::uint32_t machine_size) const noexcept {
    const SampleStreamHeader own = of(machine_size, samples);
    return magic == own.magic && machine_bytes == own.machine_bytes &&
           sample_bytes == own.sample_bytes;
  }
};
static_assert(std::is_trivially_copyable_v<SampleStreamHeader>);
static_assert(std::endian::native == std::endian::little && sizeof(Sample) == 72 &&
              sizeof(SampleStreamHeader) == 24);

}  // namespace cutforce::hal
