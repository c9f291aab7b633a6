// The bytes of a file or pipe, unpacked where they are gzip (told by the magic bytes, not by the
// name). Assumes nothing about the length: memory is two fixed buffers, whatever comes through.
#pragma once

#include <cstddef>
#include <expected>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "hal/host/input_error.hpp"

namespace cutforce::hal::host {

// Why no more bytes come. Where that is in the text, only the one who counts lines knows.
struct ByteError {
  std::string what;
  std::string remedy;
};

class ByteSource {
 public:
  // Fails iff the file cannot be opened, or its first bytes cannot be read.
  [[nodiscard]] static std::expected<ByteSource, InputError> open(
      const std::filesystem::path& path);

  ByteSource(ByteSource&&) noexcept;
  ByteSource& operator=(ByteSource&&) noexcept;
  ~ByteSource();

  // Fills the front of `out` and returns how many bytes; 0 at the end. Bytes that came before
  // damage are delivered first. Fails iff the system refuses, or the gzip data is damaged, cut, or
  // followed by something else.
  [[nodiscard]] std::expected<std::size_t, ByteError> read(std::span<char> out);

  // True, and they are taken, iff these bytes come next; otherwise nothing is taken. Damage shows
  // at the next read.
  [[nodiscard]] bool skip(std::string_view expected);

  [[nodiscard]] const std::string& name() const noexcept;

 private:
  struct Impl;
  explicit ByteSource(std::unique_ptr<Impl> impl) noexcept;

  std::unique_ptr<Impl> impl_;
};

}  // namespace cutforce::hal::host
