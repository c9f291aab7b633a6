// One line in a file of /sys or /proc, read or written. For opening only: allocates.
#pragma once

#include <expected>
#include <optional>
#include <string>

#include "hal/linux/open_error.hpp"

namespace cutforce::hal::os {

// Without the line end. Empty: there is no such file, or it cannot be read.
[[nodiscard]] std::optional<std::string> read_attribute(const std::string& path);
// Decimal text, as the kernel writes it, in any locale. Empty also where it is no number.
[[nodiscard]] std::optional<double> read_number_attribute(const std::string& path);
// Fails iff the kernel refuses the value; it says why at write, not at close.
[[nodiscard]] std::expected<void, OpenError> write_attribute(const std::string& path,
                                                             const std::string& value);

}  // namespace cutforce::hal::os
