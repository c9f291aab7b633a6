// Samples from a Linux IIO device with a triggered buffer, as hal::SampleSource has it.
//
// Time is the device's own in_timestamp. Where it has none, time_ns counts periods from the first
// sample: it has no gaps then, and lost samples go unseen; has_time() says so, and the service
// tells the person. Lost samples are those that a gap of more than 1.5 periods leaves room for.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <vector>

#include "hal/linux/file_descriptor.hpp"
#include "hal/linux/iio_device.hpp"
#include "hal/sample_source.hpp"

namespace cutforce::hal::os {

class IioSource {
 public:
  // Fails iff describe() or start_buffer() does, or the device's node cannot be opened.
  [[nodiscard]] static std::expected<IioSource, OpenError> open(const IioConfig& config);

  IioSource(IioSource&&) noexcept = default;
  IioSource& operator=(IioSource&&) = delete;
  ~IioSource();

  // kLinkLost: the device is gone. kMalformed: time went back.
  [[nodiscard]] std::expected<Reading, PortError> read(std::span<Sample> block) noexcept;
  [[nodiscard]] bool has_time() const noexcept { return setup_.time_offset.has_value(); }
  // For poll(): readable when the watermark is reached.
  [[nodiscard]] int descriptor() const noexcept { return device_.get(); }

 private:
  IioSource(const IioConfig& config, IioSetup setup, FileDescriptor device);

  [[nodiscard]] Sample convert(std::span<const std::byte> scan) noexcept;

  IioSetup setup_;
  FileDescriptor device_;
  std::int64_t period_ns_;
  std::vector<std::byte> bytes_;  // read, not yet converted; sized at opening
  std::size_t kept_ = 0;          // of a scan that came in part
  std::optional<std::int64_t> last_ns_;
  std::uint64_t counted_ = 0;
};
static_assert(SampleSource<IioSource>);

}  // namespace cutforce::hal::os
