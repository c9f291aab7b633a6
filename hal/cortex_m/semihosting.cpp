#include "hal/cortex_m/semihosting.hpp"

#include <algorithm>
#include <array>

namespace cutforce::hal::cortex_m::semihosting {
namespace {

enum class Operation : std::int32_t {
  kOpen = 0x01,
  kWriteCharacter = 0x03,
  kRead = 0x06,
  kCommandLine = 0x15,
  kExitExtended = 0x20,
};

std::int32_t call(Operation operation, const void* block) noexcept {
  std::int32_t result = 0;
  asm volatile(
      "mov r0, %1\n\t"
      "mov r1, %2\n\t"
      "bkpt 0xab\n\t"
      "mov %0, r0"
      : "=r"(result)
      : "r"(operation), "r"(block)
      : "r0", "r1", "memory");
  return result;
}

}  // namespace

void write(std::string_view text) noexcept {
  for (const char character : text) call(Operation::kWriteCharacter, &character);
}

void exit(int status) noexcept {
  constexpr std::uint32_t kApplicationExit = 0x20026;
  const std::array<std::uint32_t, 2> block{kApplicationExit, static_cast<std::uint32_t>(status)};
  for (;;) call(Operation::kExitExtended, block.data());
}

std::string_view command_line(std::span<char> line) noexcept {
  struct {
    char* buffer;
    std::uint32_t size;
  } block{line.data(), static_cast<std::uint32_t>(line.size())};
  if (line.empty() || call(Operation::kCommandLine, &block) != 0) return {};
  std::string_view rest{line.data(), std::min<std::size_t>(block.size, line.size())};
  const auto image = std::min(rest.find(' '), rest.size());
  rest.remove_prefix(std::min(image + 1, rest.size()));  // substr() may throw
  return rest;
}

std::expected<File, PortError> File::open(std::string_view name) noexcept {
  constexpr std::uint32_t kReadBinary = 1;
  // The host wants a zero behind the name.
  std::array<char, 256> path{};
  if (name.size() >= path.size()) return std::unexpected{PortError::kSystem};
  std::ranges::copy(name, path.begin());
  const struct {
    const char* name;
    std::uint32_t mode;
    std::uint32_t length;
  } block{path.data(), kReadBinary, static_cast<std::uint32_t>(name.size())};
  const std::int32_t handle = call(Operation::kOpen, &block);
  if (handle < 0) return std::unexpected{PortError::kSystem};
  return File{handle};
}

std::expected<std::size_t, PortError> File::read(std::span<std::byte> bytes) noexcept {
  const struct {
    std::int32_t handle;
    std::byte* buffer;
    std::uint32_t size;
  } block{handle_, bytes.data(), static_cast<std::uint32_t>(bytes.size())};
  // The answer is how many bytes are missing.
  const std::int32_t missing = call(Operation::kRead, &block);
  if (missing < 0 || static_cast<std::size_t>(missing) > bytes.size()) {
    return std::unexpected{PortError::kSystem};
  }
  return bytes.size() - static_cast<std::size_t>(missing);
}

}  // namespace cutforce::hal::cortex_m::semihosting
