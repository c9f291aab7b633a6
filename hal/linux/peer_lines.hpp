// The lines of the override byte at the CNC's end, for a program that plays the CNC (cutforce cnc):
// data, strobe, alive and alarm are inputs, inhibit is an output. GpioConfig with the roles turned
// round; its initial byte, its times and its acknowledge mean nothing here. peer_lines_v1.cpp is
// for libgpiod 1.6 and peer_lines_v2.cpp for 2.x, as with gpio_lines.hpp.
//
// The kernel keeps 16 edges of a line (all lines: 16 times their number with libgpiod 2) that have
// not been fetched: 0.3 s of the alive line.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <memory>
#include <span>

#include "hal/linux/byte_latch.hpp"
#include "hal/linux/gpio_config.hpp"

namespace cutforce::hal::os {

class PeerLines {
 public:
  // Fails iff check() or choose() does, or the kernel refuses a line: then it names who holds it,
  // or that the chip detects no edges.
  [[nodiscard]] static std::expected<PeerLines, OpenError> open(const GpioConfig& config);

  PeerLines(PeerLines&&) noexcept;
  PeerLines& operator=(PeerLines&&) noexcept;
  ~PeerLines();

  // As ByteLatch wants them; stamped by CLOCK_MONOTONIC.
  [[nodiscard]] std::expected<std::size_t, PortError> edges(std::span<LineEdge> edges) noexcept;
  // Read one after the other, as the chip does it. Lines that there are not read 0.
  [[nodiscard]] std::expected<std::uint8_t, PortError> data() noexcept;
  [[nodiscard]] std::expected<bool, PortError> alarm() noexcept;
  [[nodiscard]] std::expected<void, PortError> set_inhibit(bool active) noexcept;

 private:
  struct Impl;
  explicit PeerLines(std::unique_ptr<Impl> impl) noexcept;

  std::unique_ptr<Impl> impl_;
};
static_assert(PeerLineSet<PeerLines>);

}  // namespace cutforce::hal::os
