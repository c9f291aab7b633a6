#include "hal/host/table_header.hpp"

#include <algorithm>
#include <utility>

#include "hal/host/number_text.hpp"
#include "hal/host/plain_text.hpp"

namespace cutforce::hal::host {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

std::unexpected<InputError> refused(const LineReader& lines, std::size_t column, std::string what,
                                    std::string remedy) {
  const std::size_t line = lines.number() == 0 ? 1 : lines.number();
  return std::unexpected{error_at(lines.name(), line, column, std::move(what), std::move(remedy))};
}

std::unexpected<InputError> not_text(const LineReader& lines, std::size_t index) {
  return refused(lines, index + 1, "this is not UTF-8 text",
                 "give a CSV file in UTF-8, plain or gzip");
}

std::expected<void, InputError> check_first_line(const LineReader& lines,
                                                 std::string_view first_line) {
  std::string_view line = lines.line();
  if (line.starts_with(kByteOrderMark)) line.remove_prefix(kByteOrderMark.size());
  line = trimmed(line);
  if (line == first_line) return {};
  const std::string remedy = "begin the file with the line '" + std::string(first_line) + "'";
  const std::string_view any_version = first_line.substr(0, first_line.rfind(' ') + 1);
  if (line.starts_with(any_version)) {
    return refused(lines, any_version.size() + 1,
                   "version " + in_quotes(line.substr(any_version.size())) + " is not known",
                   "give a file of version " + std::string(first_line.substr(any_version.size())));
  }
  return refused(lines, 1, "the first line is not '" + std::string(first_line) + "'", remedy);
}

void split_names(std::string_view line, TableHeader& header) {
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    header.names.emplace_back(trimmed(line.substr(begin, end - begin)));
    header.name_columns.push_back(begin + 1);
    begin = end + 1;
  }
}

// A comment without a colon is for people and says nothing to the program.
void add_metadata(const LineReader& lines, TableHeader& header) {
  const std::string_view text = lines.line().substr(1);
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos) return;
  header.metadata.push_back({.key = std::string(trimmed(text.substr(0, colon))),
                             .value = std::string(trimmed(text.substr(colon + 1))),
                             .line = lines.number()});
}

}  // namespace

auto read_table_header(LineReader& lines, std::string_view first_line)
    -> std::expected<TableHeader, InputError> {
  TableHeader header{};
  while (true) {
    const auto status = lines.next();
    if (status == LineReader::Status::kError) return std::unexpected{lines.error()};
    if (status == LineReader::Status::kEnd) {
      return lines.number() == 0
                 ? refused(lines, 1, "the file is empty", "give a file with content")
                 : refused(lines, lines.line().size() + 1,
                           "the file ends before the line of column names", "give the whole file");
    }
    const std::string_view line = lines.line();
    if (const auto junk = find_non_text(line); junk != std::string_view::npos) {
      return not_text(lines, junk);
    }
    if (lines.number() == 1) {
      const auto checked = check_first_line(lines, first_line);
      if (!checked) return std::unexpected{checked.error()};
    } else if (line.starts_with('#')) {
      add_metadata(lines, header);
    } else if (!trimmed(line).empty()) {
      split_names(line, header);
      header.line = lines.number();
      return header;
    }
  }
}

}  // namespace cutforce::hal::host
