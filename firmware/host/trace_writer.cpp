#include "firmware/host/trace_writer.hpp"

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

#include "estimator/fault.hpp"
#include "firmware/host/trace_format.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::InputError;

constexpr std::size_t kMaxFaultBytes = [] {
  std::size_t bytes = 0;
  for (const std::string_view name : estimator::kFaultNames) bytes += name.size() + 1;
  return bytes;
}();
constexpr std::size_t kMaxRowBytes =
    kTraceColumns.size() * (hal::host::kMaxNumberChars + 1) + kMaxFaultBytes;

// A value that the enumeration does not have becomes an empty cell.
template <class Enum, std::size_t N>
std::string_view name_of(Enum value, const std::array<std::string_view, N>& names) noexcept {
  const auto index = static_cast<std::size_t>(value);
  return index < N ? names[index] : std::string_view{};
}

void put_faults(hal::host::TextRows& rows, estimator::FaultSet faults) noexcept {
  if (faults.empty()) return rows.empty();
  std::array<char, kMaxFaultBytes> text;
  std::size_t length = 0;
  for (std::size_t i = 0; i < estimator::kFaultCount; ++i) {
    if (!faults.contains(static_cast<estimator::Fault>(i))) continue;
    if (length > 0) text[length++] = kFaultSeparator;
    length += estimator::kFaultNames[i].copy(text.data() + length, text.size() - length);
  }
  rows.text({text.data(), length});
}

}  // namespace

TraceWriter::TraceWriter(hal::host::TextRows rows) : rows_(std::move(rows)) {}

auto TraceWriter::create(const std::filesystem::path& path)
    -> std::expected<TraceWriter, InputError> {
  auto file = hal::host::OutputFile::create(path);
  if (!file) return std::unexpected{file.error()};
  hal::host::TextRows rows(std::move(*file), kMaxRowBytes);
  std::string names;
  for (const TraceColumn& column : kTraceColumns) {
    names += (names.empty() ? "" : ",") + std::string(column.name);
  }
  for (const std::string_view line : {kTraceFirstLine, std::string_view(names)}) {
    if (auto written = rows.line(line); !written) return std::unexpected{written.error()};
  }
  return TraceWriter{std::move(rows)};
}

auto TraceWriter::write(const LoopOutput& output) -> std::expected<void, InputError> {
  for (const TraceColumn& column : kTraceColumns) {
    switch (column.role) {
      case TraceRole::kTime:
        rows_.time(output.time_ns);
        break;
      case TraceRole::kNumber:
        if ((output.present & column.present) != 0) {
          rows_.number(output.*column.number);
        } else {
          rows_.empty();
        }
        break;
      case TraceRole::kSource:
        rows_.text(name_of(output.source, kSourceNames));
        break;
      case TraceRole::kState:
        rows_.text(name_of(output.state, kStateNames));
        break;
      case TraceRole::kFault:
        put_faults(rows_, output.faults);
        break;
    }
  }
  return rows_.end_row();
}

auto TraceWriter::write(std::span<const LoopOutput> outputs) -> std::expected<void, InputError> {
  for (const LoopOutput& output : outputs) {
    if (auto written = write(output); !written) return written;
  }
  return {};
}

auto TraceWriter::finish() -> std::expected<void, InputError> { return rows_.finish(); }

}  // namespace cutforce::firmware::host
