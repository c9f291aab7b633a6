#include "hal/host/recording_writer.hpp"

#include <array>
#include <cassert>
#include <charconv>
#include <cmath>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>

#include "hal/host/csv_recording.hpp"
#include "hal/host/line_reader.hpp"
#include "hal/host/number_text.hpp"
#include "hal/host/output_file.hpp"
#include "hal/host/plain_text.hpp"
#include "hal/host/truth_reader.hpp"

namespace cutforce::hal::host {
namespace {

constexpr std::uint32_t kAlways = bit(Signal::kVoltageU) | bit(Signal::kVoltageV) |
                                  bit(Signal::kVoltageW) | bit(Signal::kCurrentU) |
                                  bit(Signal::kCurrentV);

// A value with two names (units) is written under the first.
std::vector<Column> columns_of(const RecordingLayout& layout) {
  std::vector<Column> columns;
  std::uint32_t signals_left = layout.signals | kAlways;
  for (const Column& column : known_columns()) {
    const auto voltage = voltage_kind_of(column);
    if (voltage && *voltage != layout.voltage_kind) continue;
    if (column.role == ColumnRole::kSample && (signals_left & bit(column)) == 0) continue;
    if (column.role == ColumnRole::kTruth && (layout.truths & bit(column)) == 0) continue;
    if (column.role == ColumnRole::kSample) signals_left &= ~bit(column);
    columns.push_back(column);
  }
  return columns;
}

bool is_one_line(std::string_view text) {
  return find_non_text(text) == std::string_view::npos && trimmed(text) == text;
}

std::expected<void, InputError> check_metadata(const std::string& file,
                                               std::span<const Metadata> metadata) {
  for (const Metadata& entry : metadata) {
    const bool key_sound = is_one_line(entry.key) && entry.key.find(':') == std::string::npos;
    if (key_sound && is_one_line(entry.value) &&
        entry.key.size() + entry.value.size() + 4 <= LineReader::kMaxLineBytes) {
      continue;
    }
    return std::unexpected{InputError{.where = file + ": metadata " + in_quotes(entry.key),
                                      .what = "the entry does not fit one line of text",
                                      .remedy = "give key and value as one line of UTF-8"}};
  }
  return {};
}

std::expected<void, InputError> write_header(TextRows& rows, std::span<const Metadata> metadata,
                                             std::span<const Column> columns) {
  if (auto written = rows.line(kRecordingFirstLine); !written) return written;
  for (const Metadata& entry : metadata) {
    if (auto written = rows.line("# " + entry.key + ": " + entry.value); !written) return written;
  }
  std::string names;
  for (const Column& column : columns)
    names += (names.empty() ? "" : ",") + std::string(column.name);
  return rows.line(names);
}

// In other units than it is stored in: the shortest text that reads back as the same float.
void put_scaled(TextRows& rows, float value, double units_per_si) {
  if (!std::isfinite(value)) return rows.empty();
  constexpr int kFirstDigits = 6;
  constexpr int kLastDigits = 17;
  const double exact = static_cast<double>(value) * units_per_si;
  char text[kMaxNumberChars];
  for (int digits = kFirstDigits; digits <= kLastDigits; ++digits) {
    const char* const end =
        std::to_chars(text, text + kMaxNumberChars, exact, std::chars_format::general, digits).ptr;
    const auto read = read_number<double>(text, end);
    if (digits == kLastDigits || static_cast<float>(read.value / units_per_si) == value) {
      return rows.text({text, static_cast<std::size_t>(end - text)});
    }
  }
}

}  // namespace

RecordingWriter::RecordingWriter(Rows rows, std::vector<Column> columns, std::string file)
    : rows_(std::move(rows)), columns_(std::move(columns)), file_(std::move(file)) {}

auto RecordingWriter::create(const std::filesystem::path& path, const RecordingLayout& layout)
    -> std::expected<RecordingWriter, InputError> {
  if (auto checked = check_metadata(path.string(), layout.metadata); !checked) {
    return std::unexpected{checked.error()};
  }
  auto file = OutputFile::create(path);
  if (!file) return std::unexpected{file.error()};
  std::vector<Column> columns = columns_of(layout);
  const bool gzip = path.extension() == ".gz";
  if ((gzip ? path.stem() : path).extension() == ".cfr") {
    auto rows = BinaryRowsWriter::begin(std::move(*file), layout.metadata, columns);
    if (!rows) return std::unexpected{rows.error()};
    return RecordingWriter{std::move(*rows), std::move(columns), path.string()};
  }
  TextRows rows(std::move(*file), columns.size() * (kMaxNumberChars + 1));
  if (auto written = write_header(rows, layout.metadata, columns); !written) {
    return std::unexpected{written.error()};
  }
  return RecordingWriter{std::move(rows), std::move(columns), path.string()};
}

auto RecordingWriter::write(std::span<const Sample> samples, std::span<const Truth> truths)
    -> std::expected<void, InputError> {
  assert(truths.empty() || truths.size() == samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Sample& sample = samples[i];
    if (sample.time_ns <= last_time_ns_) {
      return std::unexpected{InputError{.where = file_,
                                        .what = "the time of a row is not after the row before",
                                        .remedy = "write rows in order of time"}};
    }
    last_time_ns_ = sample.time_ns;
    const Truth truth = truths.empty() ? Truth{} : truths[i];
    auto* const text = std::get_if<TextRows>(&rows_);
    const auto written = text != nullptr ? write_text(*text, sample, truth)
                                         : std::get<BinaryRowsWriter>(rows_).write(sample, truth);
    if (!written) return written;
  }
  return {};
}

auto RecordingWriter::write_text(TextRows& rows, const Sample& sample, const Truth& truth) const
    -> std::expected<void, InputError> {
  rows.time(sample.time_ns);
  for (const Column& column : std::span(columns_).subspan(1)) {
    const std::uint32_t present =
        column.role == ColumnRole::kSample ? sample.present : truth.present;
    if ((present & bit(column)) == 0) {
      rows.empty();
      continue;
    }
    float value = 0.0F;
    std::memcpy(&value, field(column, sample, truth), sizeof value);
    if (column.units_per_si == 1.0) {
      rows.number(value);
    } else {
      put_scaled(rows, value, column.units_per_si);
    }
  }
  return rows.end_row();
}

auto RecordingWriter::finish() -> std::expected<void, InputError> {
  return std::visit([](auto& rows) { return rows.finish(); }, rows_);
}

auto convert_recording(const std::filesystem::path& from, const std::filesystem::path& to)
    -> std::expected<void, InputError> {
  constexpr std::size_t kBlock = 1024;
  auto reader = TruthReader::open(from);
  if (!reader) return std::unexpected{reader.error()};
  const RecordingInfo& info = reader->info();
  auto writer = RecordingWriter::create(to, {.metadata = info.metadata,
                                             .voltage_kind = info.voltage_kind,
                                             .signals = info.signals,
                                             .truths = info.truths});
  if (!writer) return std::unexpected{writer.error()};
  std::vector<Sample> samples(kBlock);
  std::vector<Truth> truths(kBlock);
  while (true) {
    const auto count = reader->read(samples, truths);
    if (!count) return std::unexpected{count.error()};
    if (*count == 0) return writer->finish();
    const auto written =
        writer->write(std::span(samples).first(*count), std::span(truths).first(*count));
    if (!written) return written;
  }
}

}  // namespace cutforce::hal::host
