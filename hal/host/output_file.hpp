// A file that is there whole or not at all: written under a temporary name in the same folder and
// renamed when it is finished; removed when it is not. Packed by gzip where the name ends in .gz.
// What is no regular file (a terminal, a pipe, /dev/null) is written to directly.
#pragma once

#include <expected>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "hal/host/input_error.hpp"

namespace cutforce::hal::host {

class OutputFile {
 public:
  // Fails iff the temporary file cannot be made.
  [[nodiscard]] static std::expected<OutputFile, InputError> create(
      const std::filesystem::path& path);

  OutputFile(OutputFile&&) noexcept;
  OutputFile& operator=(OutputFile&&) noexcept;
  ~OutputFile();  // without finish(): leaves nothing behind

  // Both fail iff the system refuses (disk full, permissions); the file is then given up.
  [[nodiscard]] std::expected<void, InputError> write(std::span<const char> bytes);
  [[nodiscard]] std::expected<void, InputError> finish();

  [[nodiscard]] const std::string& name() const noexcept;

 private:
  struct Impl;
  explicit OutputFile(std::unique_ptr<Impl> impl) noexcept;

  std::unique_ptr<Impl> impl_;
};

}  // namespace cutforce::hal::host
