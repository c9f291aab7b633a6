// The lines of one GPIO chip, requested and ready to change: what the two libgpiod APIs have in
// common. gpio_lines_v1.cpp is for libgpiod 1.6 (Debian 12), gpio_lines_v2.cpp for 2.x (Debian 13);
// the build takes the one that fits the library it finds. All lines are outputs or inputs with
// their safe levels from the request on: data the initial byte, strobe, alive and alarm inactive.
// No call but open() allocates.
#pragma once

#include <cstdint>
#include <expected>
#include <memory>

#include "hal/linux/byte_sequence.hpp"
#include "hal/linux/gpio_config.hpp"

namespace cutforce::hal::os {

class GpioLines {
 public:
  // Fails iff check() or choose() does, or the kernel refuses a line: then it names who holds it.
  [[nodiscard]] static std::expected<GpioLines, OpenError> open(const GpioConfig& config);

  GpioLines(GpioLines&&) noexcept;
  GpioLines& operator=(GpioLines&&) noexcept;
  ~GpioLines();

  // The data lines may change one after the other, in any order.
  [[nodiscard]] std::expected<void, PortError> set_data(std::uint8_t byte) noexcept;
  [[nodiscard]] std::expected<void, PortError> set_strobe(bool active) noexcept;
  [[nodiscard]] std::expected<void, PortError> set_alive(bool active) noexcept;
  [[nodiscard]] std::expected<void, PortError> set_alarm(bool active) noexcept;
  [[nodiscard]] std::expected<bool, PortError> acknowledge() noexcept;
  [[nodiscard]] std::expected<bool, PortError> inhibit() noexcept;

 private:
  struct Impl;
  explicit GpioLines(std::unique_ptr<Impl> impl) noexcept;

  std::unique_ptr<Impl> impl_;
};
static_assert(ByteLines<GpioLines>);

}  // namespace cutforce::hal::os
