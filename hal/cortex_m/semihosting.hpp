// Semihosting: a debugger or QEMU does what the image asks for. Only in images made for that: on a
// board without a debugger the instruction is a fault.
//
// Operations and parameter blocks: "Semihosting for AArch32 and AArch64", Arm.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <string_view>

#include "hal/port.hpp"

namespace cutforce::hal::cortex_m::semihosting {

void write(std::string_view text) noexcept;
[[noreturn]] void exit(int status) noexcept;

// What follows the image's name on the command line, in the front of `line`; empty: nothing, or it
// does not fit.
[[nodiscard]] std::string_view command_line(std::span<char> line) noexcept;

class File {
 public:
  // For reading. Fails with kSystem iff the host cannot open it.
  [[nodiscard]] static std::expected<File, PortError> open(std::string_view name) noexcept;

  // Fills `bytes` as far as the file goes and returns how many. Fails iff the host refuses.
  [[nodiscard]] std::expected<std::size_t, PortError> read(std::span<std::byte> bytes) noexcept;

 private:
  explicit File(std::int32_t handle) noexcept : handle_(handle) {}
  std::int32_t handle_;
};

}  // namespace cutforce::hal::cortex_m::semihosting
