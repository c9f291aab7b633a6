// Chosen columns of a CSV file, plain or gzip, for the report alone. Lines that begin with # before
// the header are skipped; an empty cell is NaN, or the empty word.
#pragma once

#include <cstdint>
#include <expected>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

struct Words {
  std::vector<std::string> dictionary;
  std::vector<std::uint32_t> index;  // one per row
};

struct Columns {
  std::map<std::string, std::vector<double>, std::less<>> numbers;
  std::map<std::string, Words, std::less<>> words;

  // nullptr: the file has no such column, or nothing but empty cells in it.
  [[nodiscard]] const std::vector<double>* find(std::string_view name) const;
};

struct WantedColumns {
  std::vector<std::string_view> numbers;
  std::vector<std::string_view> words;
};

// Fails iff the file cannot be read to its end, has no column t_s, a line of more than 64 KiB,
// a wanted number that is none, or a time that does not increase. Columns that are not there, or
// not wanted, are no error.
[[nodiscard]] std::expected<Columns, hal::host::InputError> read_columns(
    const std::filesystem::path& path, const WantedColumns& wanted);

}  // namespace cutforce::firmware::host
