#include "hal/linux/attribute_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <system_error>

#include "hal/linux/file_descriptor.hpp"

namespace cutforce::hal::os {

std::optional<std::string> read_attribute(const std::string& path) {
  const FileDescriptor file{::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  if (!file) return std::nullopt;
  std::array<char, 4096> text{};  // a page: no attribute is longer
  const auto size = ::read(file.get(), text.data(), text.size());
  if (size < 0) return std::nullopt;
  std::string line(text.data(), static_cast<std::size_t>(size));
  while (!line.empty() && (line.back() == '\n' || line.back() == ' ')) line.pop_back();
  return line;
}

std::optional<double> read_number_attribute(const std::string& path) {
  const auto text = read_attribute(path);
  if (!text) return std::nullopt;
  double number = 0.0;
  const auto* end = text->data() + text->size();
  const auto [stop, error] = std::from_chars(text->data(), end, number);
  if (error != std::errc{} || stop != end) return std::nullopt;
  return number;
}

auto write_attribute(const std::string& path, const std::string& value)
    -> std::expected<void, OpenError> {
  const FileDescriptor file{::open(path.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC)};
  if (file && ::write(file.get(), value.data(), value.size()) >= 0) return {};
  const int error = errno;
  return std::unexpected{OpenError{
      path, "\"" + value + "\" cannot be written: " + std::strerror(error),
      error == EACCES || error == EPERM ? "give the service's user the right to write there"
      : error == EBUSY
          ? "end the program that uses the device's buffer"
          : "take a value that the driver knows (see the *_available file beside it)"}};
}

}  // namespace cutforce::hal::os
