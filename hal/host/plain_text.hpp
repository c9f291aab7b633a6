// Text as people and files hold it: what is UTF-8, and how it is shown in a message.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace cutforce::hal::host {

// Index of the first byte that is no part of UTF-8 text (control characters other than tab
// included), or npos.
[[nodiscard]] std::size_t find_non_text(std::string_view bytes) noexcept;

// In quotes, cut to a length that a person reads at a glance; what is no text is left out.
[[nodiscard]] std::string in_quotes(std::string_view text);

// Without spaces, tabs and carriage returns at both ends.
[[nodiscard]] std::string_view trimmed(std::string_view text) noexcept;

}  // namespace cutforce::hal::host
