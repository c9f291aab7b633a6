// Lines of a byte source, as views into one fixed buffer: no allocation, no copy a line.
// A line ends with LF or CR LF; the last one may end with the file. Lines are limited to 64 KiB, so
// that a file that is one endless line is refused after one buffer and not after its last byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "hal/host/byte_source.hpp"
#include "hal/host/input_error.hpp"

namespace cutforce::hal::host {

// file:line:column, both counted from 1, columns in bytes.
[[nodiscard]] InputError error_at(const std::string& file, std::size_t line, std::size_t column,
                                  std::string what, std::string remedy);

class LineReader {
 public:
  static constexpr std::size_t kMaxLineBytes = std::size_t{64} * 1024;

  enum class Status : std::uint8_t { kLine, kEnd, kError };

  explicit LineReader(ByteSource source);

  // kLine: line() is the next one, without its end, valid until the next call. kError: error()
  // says why, here the source failed or the line is too long; it stays so.
  [[nodiscard]] Status next();

  [[nodiscard]] std::string_view line() const noexcept { return line_; }
  [[nodiscard]] std::size_t number() const noexcept { return number_; }  // of line(), from 1
  [[nodiscard]] const InputError& error() const noexcept { return error_; }
  [[nodiscard]] const std::string& name() const noexcept { return source_.name(); }

 private:
  Status take(std::size_t length, std::size_t ending);
  Status fill();
  Status too_long();

  ByteSource source_;
  std::unique_ptr<char[]> buffer_;  // untouched pages cost nothing: many recordings are short
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  bool ended_ = false;
  bool failed_ = false;
  std::string_view line_;
  std::size_t number_ = 0;
  InputError error_;
};

}  // namespace cutforce::hal::host
