// A sample stream (hal/sample_stream.hpp) behind hal::Port, for an image under a debugger or QEMU.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <string_view>

#include "hal/cortex_m/semihosting.hpp"
#include "hal/port.hpp"
#include "hal/sample_stream.hpp"

namespace cutforce::hal::cortex_m {

class StreamPort {
 public:
  // Reads the header and fills `machine` with the parameters that follow it. Fails with kSystem
  // where the file cannot be read, with kMalformed where another build has written it.
  [[nodiscard]] static std::expected<StreamPort, PortError> open(
      std::string_view name, std::span<std::byte> machine) noexcept;

  // Fails with kMalformed where the file ends before its last sample.
  [[nodiscard]] std::expected<std::size_t, PortError> read(std::span<Sample> block) noexcept;
  [[nodiscard]] std::expected<void, PortError> write(const Command&) noexcept { return {}; }

 private:
  StreamPort(semihosting::File file, std::uint64_t samples) noexcept
      : file_(file), samples_left_(samples) {}

  semihosting::File file_;
  std::uint64_t samples_left_;
};
static_assert(Port<StreamPort>);

}  // namespace cutforce::hal::cortex_m
