#include "firmware/host/trace_reader.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "estimator/fault.hpp"
#include "hal/host/byte_source.hpp"
#include "hal/host/number_text.hpp"
#include "hal/host/plain_text.hpp"
#include "hal/host/table_header.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::CellState;
using hal::host::describe;
using hal::host::InputError;
using hal::host::LineReader;

template <std::size_t N>
std::optional<std::size_t> index_of(std::string_view name,
                                    const std::array<std::string_view, N>& names) noexcept {
  const auto* const found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) return std::nullopt;
  return static_cast<std::size_t>(found - names.begin());
}

// Empty where one of the names is unknown.
std::optional<estimator::FaultSet> faults_of(std::string_view cell) noexcept {
  estimator::FaultSet faults;
  while (!cell.empty()) {
    const std::size_t end = std::min(cell.find(kFaultSeparator), cell.size());
    const auto index = index_of(cell.substr(0, end), estimator::kFaultNames);
    if (!index) return std::nullopt;
    faults.insert(static_cast<estimator::Fault>(*index));
    cell.remove_prefix(std::min(end + 1, cell.size()));
  }
  return faults;
}

constexpr bool is_sigma(const TraceColumn& column) noexcept {
  return column.name.find("_sigma_") != std::string_view::npos;
}

std::expected<std::vector<const TraceColumn*>, InputError> map_names(
    const std::string& file, const hal::host::TableHeader& header) {
  std::vector<const TraceColumn*> columns;
  for (std::size_t i = 0; i < header.names.size(); ++i) {
    const auto* const found =
        std::find_if(kTraceColumns.begin(), kTraceColumns.end(),
                     [&](const TraceColumn& column) { return column.name == header.names[i]; });
    const TraceColumn* const column = found == kTraceColumns.end() ? nullptr : found;
    if (column != nullptr && std::find(columns.begin(), columns.end(), column) != columns.end()) {
      return std::unexpected{hal::host::error_at(file, header.line, header.name_columns[i],
                                                 "column " + header.names[i] + " is there twice",
                                                 "leave out one of them")};
    }
    columns.push_back(column);
  }
  for (const TraceColumn& column : kTraceColumns) {
    if (std::find(columns.begin(), columns.end(), &column) != columns.end()) continue;
    return std::unexpected{hal::host::error_at(file, header.line, 1,
                                               "column " + std::string(column.name) + " is missing",
                                               "give a trace as cutforce writes it")};
  }
  return columns;
}

}  // namespace

TraceReader::TraceReader(LineReader lines, std::vector<const TraceColumn*> columns)
    : lines_(std::move(lines)), columns_(std::move(columns)) {}

auto TraceReader::open(const std::filesystem::path& path)
    -> std::expected<TraceReader, InputError> {
  auto source = hal::host::ByteSource::open(path);
  if (!source) return std::unexpected{source.error()};
  LineReader lines(std::move(*source));
  const auto header = hal::host::read_table_header(lines, kTraceFirstLine);
  if (!header) return std::unexpected{header.error()};
  auto columns = map_names(lines.name(), *header);
  if (!columns) return std::unexpected{columns.error()};
  return TraceReader{std::move(lines), std::move(*columns)};
}

auto TraceReader::read(std::span<LoopOutput> block) -> std::expected<std::size_t, InputError> {
  std::size_t count = 0;
  while (count < block.size() && !failed_) {
    const auto status = lines_.next();
    if (status == LineReader::Status::kEnd) break;
    failed_ = status == LineReader::Status::kError ? lines_.error() : read_row(block[count]);
    if (!failed_) ++count;
  }
  if (count == 0 && failed_) return std::unexpected{*failed_};
  return count;
}

std::optional<InputError> TraceReader::read_row(LoopOutput& output) {
  output = LoopOutput{};
  const std::string_view row = lines_.line();
  const auto cells = static_cast<std::size_t>(std::count(row.begin(), row.end(), ',')) + 1;
  if (cells != columns_.size()) {
    return refused(row.substr(row.size()),
                   "the row has " + std::to_string(cells) + " cells where the header names " +
                       std::to_string(columns_.size()) + " columns",
                   "give one cell for each column");
  }
  std::size_t begin = 0;
  for (const TraceColumn* const column : columns_) {
    const std::size_t end = std::min(row.find(',', begin), row.size());
    if (column != nullptr) {
      auto error = read_cell(*column, row.substr(begin, end - begin), output);
      if (error) return error;
    }
    begin = end + 1;
  }
  for (const TraceColumn& column : kTraceColumns) {  // a sigma of nothing is nothing
    if (is_sigma(column) && (output.present & column.present) == 0) output.*column.number = 0.0F;
  }
  return std::nullopt;
}

std::optional<InputError> TraceReader::read_cell(const TraceColumn& column, std::string_view cell,
                                                 LoopOutput& output) {
  switch (column.role) {
    case TraceRole::kTime: {
      const auto time = hal::host::read_time(cell.data(), cell.data() + cell.size());
      if (time.state != CellState::kValue) return wrong(column, cell, describe(time.state));
      if (time.value <= last_time_ns_) return wrong(column, cell, "is not after the row before");
      output.time_ns = last_time_ns_ = time.value;
      return std::nullopt;
    }
    case TraceRole::kNumber:
      return read_number_cell(column, cell, output);
    case TraceRole::kSource: {
      const auto index = index_of(cell, kSourceNames);
      if (!index) return wrong(column, cell, "is no source");
      output.source = static_cast<Source>(*index);
      return std::nullopt;
    }
    case TraceRole::kState: {
      const auto index = index_of(cell, kStateNames);
      if (!index) return wrong(column, cell, "is no state");
      output.state = static_cast<LoopState>(*index);
      return std::nullopt;
    }
    case TraceRole::kFault: {
      const auto faults = faults_of(cell);
      if (!faults) return wrong(column, cell, "is no list of faults");
      output.faults = *faults;
      return std::nullopt;
    }
  }
  return std::nullopt;
}

std::optional<InputError> TraceReader::read_number_cell(const TraceColumn& column,
                                                        std::string_view cell, LoopOutput& output) {
  const auto number = hal::host::read_number<float>(cell.data(), cell.data() + cell.size());
  if (number.state != CellState::kValue && number.state != CellState::kEmpty) {
    return wrong(column, cell, describe(number.state));
  }
  const bool there = number.state == CellState::kValue;
  if (is_sigma(column)) {
    output.*column.number = there ? number.value : std::numeric_limits<float>::infinity();
  } else if (there) {
    output.*column.number = number.value;
    output.present |= column.present;
  }
  return std::nullopt;
}

InputError TraceReader::wrong(const TraceColumn& column, std::string_view cell,
                              std::string_view why) const {
  return refused(cell,
                 "column " + std::string(column.name) + ": " + hal::host::in_quotes(cell) + " " +
                     std::string(why),
                 "give a trace as cutforce writes it");
}

InputError TraceReader::refused(std::string_view cell, std::string what, std::string remedy) const {
  const auto column = static_cast<std::size_t>(cell.data() - lines_.line().data()) + 1;
  return hal::host::error_at(lines_.name(), lines_.number(), column, std::move(what),
                             std::move(remedy));
}

}  // namespace cutforce::firmware::host
