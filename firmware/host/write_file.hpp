// Whole text files, or none: what is written appears under its name only when it is complete.
#pragma once

#include <expected>
#include <filesystem>
#include <string_view>

#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

// hal::host::OutputFile in one call: writes a file of a temporary name beside `path`, then renames
// it. An existing file is replaced, or on failure left as it was; nothing half-written stays.
[[nodiscard]] std::expected<void, hal::host::InputError> write_file(
    const std::filesystem::path& path, std::string_view text);

}  // namespace cutforce::firmware::host
