// What stands before the rows of a recording or a trace: a first line with a version, lines
// `# key: value`, and the names of the columns.
#pragma once

#include <cstddef>
#include <expected>
#include <string>
#include <string_view>
#include <vector>

#include "hal/host/input_error.hpp"
#include "hal/host/line_reader.hpp"
#include "hal/host/recording_columns.hpp"

namespace cutforce::hal::host {

struct TableHeader {
  std::vector<Metadata> metadata;
  std::vector<std::string> names;
  std::vector<std::size_t> name_columns;  // where in its line each name starts, from 1
  std::size_t line;                       // of the names
};

// Reads up to and including the line of names. `first_line` is the required one; it ends in the
// version. Fails iff the source does, the file is empty, is no text, has another first line or
// version, or ends before the names.
[[nodiscard]] std::expected<TableHeader, InputError> read_table_header(LineReader& lines,
                                                                       std::string_view first_line);

}  // namespace cutforce::hal::host
