#include "hal/cortex_m/stream_port.hpp"

#include <algorithm>

namespace cutforce::hal::cortex_m {
namespace {

std::expected<void, PortError> read_all(semihosting::File& file,
                                        std::span<std::byte> bytes) noexcept {
  const auto count = file.read(bytes);
  if (!count) return std::unexpected{count.error()};
  if (*count != bytes.size()) return std::unexpected{PortError::kMalformed};
  return {};
}

}  // namespace

std::expected<StreamPort, PortError> StreamPort::open(std::string_view name,
                                                      std::span<std::byte> machine) noexcept {
  auto file = semihosting::File::open(name);
  if (!file) return std::unexpected{file.error()};
  SampleStreamHeader header{};
  if (const auto got = read_all(*file, std::as_writable_bytes(std::span(&header, 1))); !got) {
    return std::unexpected{got.error()};
  }
  if (!header.fits(static_cast<std::uint32_t>(machine.size()))) {
    return std::unexpected{PortError::kMalformed};
  }
  if (const auto got = read_all(*file, machine); !got) return std::unexpected{got.error()};
  return StreamPort{*file, header.samples};
}

std::expected<std::size_t, PortError> StreamPort::read(std::span<Sample> block) noexcept {
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(block.size(), samples_left_));
  if (count == 0) return 0U;
  if (const auto got = read_all(file_, std::as_writable_bytes(block.first(count))); !got) {
    return std::unexpected{got.error()};
  }
  samples_left_ -= count;
  return count;
}

}  // namespace cutforce::hal::cortex_m
