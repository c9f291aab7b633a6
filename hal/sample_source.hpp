// The contract between the board and whatever samples its signals, where that is not the CAN bus.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>

#include "hal/port.hpp"

namespace cutforce::hal {

struct Reading {
  std::size_t count;   // samples in the front of the block; 0: none has come yet
  std::uint32_t lost;  // samples that the source knows to be missing before or among them
};

// read() takes what has come, at most a block, and does not wait. It fails iff the device is gone
// or gives what it was not set up for.
template <class S>
concept SampleSource = requires(S& source, std::span<Sample> block) {
  { source.read(block) } -> std::same_as<std::expected<Reading, PortError>>;
};

}  // namespace cutforce::hal
