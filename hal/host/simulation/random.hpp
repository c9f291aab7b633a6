// Random numbers that are the same everywhere: xoshiro256++ (Blackman and Vigna, "Scrambled linear
// pseudorandom number generators", ACM TOMS 2021; public domain), seeded by splitmix64, and our own
// distributions, because those of <random> are left to each library.
// Every source of chance draws from a stream of its own: noise on one channel moves no other.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

#include "hal/host/simulation/arithmetic.hpp"

namespace cutforce::hal::host {

class RandomStream {
 public:
  constexpr RandomStream(std::uint64_t seed, std::uint64_t stream) noexcept {
    std::uint64_t z = seed + 0x9E3779B97F4A7C15U * (stream + 1) * 0x10001U;
    for (auto& word : state_) {
      z += 0x9E3779B97F4A7C15U;
      word = mixed(z);
    }
  }

  constexpr std::uint64_t next() noexcept {
    auto& s = state_;
    const std::uint64_t result = std::rotl(s[0] + s[3], 23) + s[0];
    const std::uint64_t t = s[1] << 17U;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = std::rotl(s[3], 45);
    return result;
  }

  // In [0, 1), 53 bits.
  constexpr double uniform() noexcept { return static_cast<double>(next() >> 11U) * 0x1p-53; }

  // Mean 0, variance 1: Box and Muller, both halves used.
  double normal() noexcept {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2.0 * logarithm(1.0 - uniform()));
    const auto [sine, cosine] = sine_cosine(kTwoPi * uniform());
    spare_ = radius * sine;
    has_spare_ = true;
    return radius * cosine;
  }

 private:
  static constexpr std::uint64_t mixed(std::uint64_t z) noexcept {
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
    return z ^ (z >> 31U);
  }

  std::array<std::uint64_t, 4> state_{};
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace cutforce::hal::host
