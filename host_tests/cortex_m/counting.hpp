// What the meter counts with: mean and most of many calls, a place for what is too large for a
// stack, and the stream that bodies run over.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <new>
#include <span>
#include <string_view>

#include "firmware/machine.hpp"
#include "hal/cortex_m/console.hpp"
#include "hal/cortex_m/stream_port.hpp"
#include "host_tests/benchmarks/target_bodies.hpp"

namespace cutforce::benchmarks {

class Counts {
 public:
  void add(std::uint32_t count) noexcept {
    sum_ += count;
    most_ = count > most_ ? count : most_;
    ++calls_;
  }
  // A call, or one of `parts` that it has.
  void show(std::string_view name, std::uint32_t parts = 1) const noexcept {
    if (calls_ == 0) return;
    const std::uint32_t all = calls_ * parts;
    hal::cortex_m::console::write(name);
    hal::cortex_m::console::write(" ");
    hal::cortex_m::console::write_number(static_cast<std::uint32_t>((sum_ + all / 2) / all));
    hal::cortex_m::console::write(" ");
    hal::cortex_m::console::write_number((most_ + parts - 1) / parts);
    hal::cortex_m::console::write("\n");
  }

 private:
  std::uint64_t sum_ = 0;
  std::uint32_t most_ = 0;
  std::uint32_t calls_ = 0;
};

// What is too large for a stack, one after the other in one place.
template <class T>
class Place {
 public:
  template <class... Arguments>
  T& make(Arguments&&... arguments) noexcept {
    return *new (bytes_.data()) T(static_cast<Arguments&&>(arguments)...);
  }

 private:
  alignas(T) std::array<std::byte, sizeof(T)> bytes_{};
};

// Samples of the stream that are run in and not counted, and that are.
inline constexpr std::uint32_t kRunIn = 15'000;
inline constexpr std::uint32_t kCounted = 20'000;

// The stream's first sample alone, then blocks that each end with an estimate period. Its machine
// goes where `machine` is.
template <class First, class Step>
[[nodiscard]] bool over_stream(std::string_view name, firmware::Machine& machine,
                               const First& first, const Step& step) {
  auto port = hal::cortex_m::StreamPort::open(name, std::as_writable_bytes(std::span(&machine, 1)));
  if (!port) return false;
  std::array<hal::Sample, kSamplesPerTick> block{};
  const auto read = [&port](hal::Sample& sample) {
    const auto count = port->read(std::span(&sample, 1));
    return count && *count == 1;
  };
  if (!read(block[0])) return false;
  first(block[0]);
  for (std::uint32_t k = 0; k < kRunIn + kCounted; k += kSamplesPerTick) {
    for (hal::Sample& sample : block)
      if (!read(sample)) return false;
    step(std::span<const hal::Sample>(block), k >= kRunIn);
  }
  return true;
}

}  // namespace cutforce::benchmarks
