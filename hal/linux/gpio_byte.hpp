// The override byte on the lines of a GPIO chip, as hal::BytePort has it. The destructor takes the
// sign of life away and leaves the last byte on the lines. What they do after that, and after a
// kill, is the chip driver's affair: pull resistors at the CNC choose the safe code.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>

#include "hal/byte_port.hpp"
#include "hal/linux/byte_sequence.hpp"
#include "hal/linux/gpio_config.hpp"
#include "hal/linux/gpio_lines.hpp"
#include "hal/linux/monotonic_clock.hpp"

namespace cutforce::hal::os {

class GpioByte {
 public:
  // Fails iff GpioLines::open() does.
  [[nodiscard]] static std::expected<GpioByte, OpenError> open(const GpioConfig& config);

  GpioByte(GpioByte&& other) noexcept;
  GpioByte& operator=(GpioByte&&) = delete;
  ~GpioByte();

  // Takes set-up and hold time if the byte is strobed, else some microseconds.
  [[nodiscard]] std::expected<ByteInput, PortError> write(const ByteOutput& output) noexcept;

 private:
  struct Wait {
    void operator()(std::int64_t duration_ns) const noexcept { wait_at_least(duration_ns); }
  };
  using Sequence = ByteSequence<GpioLines, Wait>;

  explicit GpioByte(Sequence sequence) noexcept;

  std::optional<Sequence> sequence_;  // empty: moved from
};
static_assert(BytePort<GpioByte>);

}  // namespace cutforce::hal::os
