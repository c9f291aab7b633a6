#include "firmware/host/run/output_folder.hpp"

#include <system_error>

namespace cutforce::firmware::host {

namespace fs = std::filesystem;

std::expected<OutputFolder, hal::host::InputError> OutputFolder::make(const fs::path& path) {
  std::vector<fs::path> missing;
  std::error_code error;
  for (fs::path at = path; !at.empty() && !fs::exists(at, error); at = at.parent_path()) {
    if (at.has_filename()) missing.push_back(at);
  }
  if (!path.empty()) fs::create_directories(path, error);
  if (!path.empty() && !fs::is_directory(path, error)) {
    return std::unexpected{hal::host::InputError{
        path.string(), "this folder cannot be made" + (error ? ": " + error.message() : ""),
        "name a folder that can be written to"}};
  }
  return OutputFolder{std::move(missing)};
}

OutputFolder::~OutputFolder() {
  std::error_code ignored;
  for (const fs::path& folder : made_) fs::remove(folder, ignored);  // only if empty
}

}  // namespace cutforce::firmware::host
