#include "firmware/host/write_file.hpp"

#include <cerrno>
#include <fstream>
#include <random>
#include <string>
#include <system_error>

namespace cutforce::firmware::host {
namespace {

namespace fs = std::filesystem;

hal::host::InputError failure(const fs::path& path, int error) {
  return {path.string(), "it cannot be written: " + std::generic_category().message(error),
          "name a file in a folder that exists, can be written to, and has room"};
}

// Empty, or the error of the first step that failed.
std::error_code put(const fs::path& path, std::string_view text, std::ios::openmode mode) {
  errno = 0;
  std::ofstream file(path, std::ios::binary | mode);
  file.write(text.data(), static_cast<std::streamsize>(text.size()));
  file.close();
  if (file) return {};
  return {errno != 0 ? errno : EIO, std::generic_category()};
}

}  // namespace

std::expected<void, hal::host::InputError> write_file(const fs::path& path, std::string_view text) {
  std::error_code error;
  // A link stays a link: what it points to is replaced.
  const fs::path target = fs::is_symlink(path, error) ? fs::weakly_canonical(path, error) : path;
  const fs::file_status before = fs::status(target, error);
  // A pipe or a device has no content to keep whole, and a new file would take its name away.
  if (fs::exists(before) && fs::is_other(before)) {
    if ((error = put(target, text, std::ios::out))) {
      return std::unexpected{failure(path, error.value())};
    }
    return {};
  }
  std::random_device random;
  fs::path part = target;
  part += "." + std::to_string(random()) + ".part";
  error = put(part, text, std::ios::out | std::ios::noreplace);
  if (!error && fs::exists(before)) fs::permissions(part, before.permissions(), error);
  if (!error) fs::rename(part, target, error);
  if (error) {
    std::error_code ignored;
    if (error != std::errc::file_exists) fs::remove(part, ignored);
    return std::unexpected{failure(path, error.value())};
  }
  return {};
}

}  // namespace cutforce::firmware::host
