#include "hal/linux/gpio_byte.hpp"

#include <utility>

namespace cutforce::hal::os {
namespace {

constexpr std::int64_t kMicrosecondNs = 1000;

}  // namespace

auto GpioByte::open(const GpioConfig& config) -> std::expected<GpioByte, OpenError> {
  auto lines = GpioLines::open(config);
  if (!lines) return std::unexpected{lines.error()};
  const ByteTiming timing{.setup_ns = config.setup_us * kMicrosecondNs,
                          .hold_ns = config.hold_us * kMicrosecondNs,
                          .has_acknowledge = config.acknowledge.has_value(),
                          .has_inhibit = config.inhibit.has_value()};
  return GpioByte{Sequence{std::move(*lines), Wait{}, timing}};
}

GpioByte::GpioByte(Sequence sequence) noexcept : sequence_(std::move(sequence)) {}

GpioByte::GpioByte(GpioByte&& other) noexcept
    : sequence_(std::exchange(other.sequence_, std::nullopt)) {}

GpioByte::~GpioByte() {
  if (sequence_) sequence_->leave();
}

auto GpioByte::write(const ByteOutput& output) noexcept -> std::expected<ByteInput, PortError> {
  return sequence_->write(output);
}

}  // namespace cutforce::hal::os
