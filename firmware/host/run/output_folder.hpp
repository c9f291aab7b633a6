// A folder for the files of a run: made where it is missing, and gone again if nothing came of it.
#pragma once

#include <expected>
#include <filesystem>
#include <vector>

#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

class OutputFolder {
 public:
  // An empty path is the working folder. Fails iff it cannot be made, or is a file.
  [[nodiscard]] static std::expected<OutputFolder, hal::host::InputError> make(
      const std::filesystem::path& path);

  OutputFolder(OutputFolder&& other) noexcept : made_(std::move(other.made_)) {
    other.made_.clear();
  }
  OutputFolder& operator=(OutputFolder&&) = delete;
  ~OutputFolder();  // without keep(): removes what it made and nobody filled

  void keep() noexcept { made_.clear(); }

 private:
  explicit OutputFolder(std::vector<std::filesystem::path> made) : made_(std::move(made)) {}

  std::vector<std::filesystem::path> made_;  // innermost first
};

}  // namespace cutforce::firmware::host
