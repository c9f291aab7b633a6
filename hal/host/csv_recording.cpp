#include "hal/host/csv_recording.hpp"

#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include "hal/host/line_reader.hpp"
#include "hal/host/number_text.hpp"
#include "hal/host/plain_text.hpp"
#include "hal/host/table_header.hpp"

namespace cutforce::hal::host {
namespace {

class CsvRows final : public RowSource {
 public:
  CsvRows(LineReader lines, RecordingInfo info, std::vector<Column> columns)
      : lines_(std::move(lines)), info_(std::move(info)), columns_(std::move(columns)) {}

  [[nodiscard]] const RecordingInfo& info() const noexcept override { return info_; }

  std::expected<std::size_t, InputError> read(std::span<Sample> samples,
                                              std::span<Truth> truths) override {
    std::size_t count = 0;
    while (count < samples.size() && !failed_) {
      const auto status = lines_.next();
      if (status == LineReader::Status::kEnd) {
        if (rows_ == 0 && count == 0) refuse_no_rows();
        break;
      }
      if (status == LineReader::Status::kError) {
        failed_ = lines_.error();
      } else if (lines_.line().empty()) {
        if (empty_line_ == 0) empty_line_ = lines_.number();
      } else if (empty_line_ != 0) {  // empty lines are tolerated at the end of the file only
        failed_ = error_at(info_.file, empty_line_, 1, "the line is empty", "remove the line");
      } else if (read_row(samples[count], truths[count])) {
        ++count;
      }
    }
    rows_ += count;
    if (count == 0 && failed_) return std::unexpected{*failed_};
    return count;
  }

 private:
  // True for a whole row; else failed_ says why.
  bool read_row(Sample& sample, Truth& truth) {
    sample = Sample{};
    truth = Truth{};
    const std::string_view row = lines_.line();
    const char* at = row.data();
    const char* const end = at + row.size();
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (i > 0) {
        if (at == end) return wrong_cell_count(at);
        ++at;  // the comma: every cell ends at one, or at the end
      }
      at = read_cell(i, at, end, sample, truth);
      if (at == nullptr) return false;
    }
    return at == end || wrong_cell_count(at);
  }

  // Returns the cell's end, or null where failed_ says why.
  const char* read_cell(std::size_t index, const char* at, const char* end, Sample& sample,
                        Truth& truth) {
    const Column& column = columns_[index];
    switch (column.role) {
      case ColumnRole::kTime:
        return read_time_cell(index, at, end, sample);
      case ColumnRole::kSample:
      case ColumnRole::kTruth:
        break;
      case ColumnRole::kIgnored:
        return skip_cell(at, end);
    }
    Cell<float> cell{};
    if (column.units_per_si == 1.0) {
      cell = read_number<float>(at, end);
    } else {
      const auto wide = read_number<double>(at, end);
      cell = {.value = static_cast<float>(wide.value / column.units_per_si),
              .state = wide.state,
              .end = wide.end};
      if (!std::isfinite(cell.value)) cell.state = CellState::kOutOfRange;
    }
    if (cell.state == CellState::kValue) [[likely]] {
      std::memcpy(field(column, sample, truth), &cell.value, sizeof cell.value);
      auto& present = column.role == ColumnRole::kSample ? sample.present : truth.present;
      present |= std::uint32_t{1} << column.signal;
      return cell.end;
    }
    if (cell.state == CellState::kEmpty) return cell.end;
    return refuse_cell(index, at, cell.end, cell.state);
  }

  const char* read_time_cell(std::size_t index, const char* at, const char* end, Sample& sample) {
    const auto cell = read_time(at, end);
    if (cell.state != CellState::kValue) return refuse_cell(index, at, cell.end, cell.state);
    if (cell.value <= last_time_ns_) return refuse_time(at, cell.value);
    last_time_ns_ = cell.value;
    sample.time_ns = cell.value;
    return cell.end;
  }

  const char* skip_cell(const char* at, const char* end) {
    const void* const comma = std::memchr(at, ',', static_cast<std::size_t>(end - at));
    const char* const stop = comma == nullptr ? end : static_cast<const char*>(comma);
    const auto junk = find_non_text({at, static_cast<std::size_t>(stop - at)});
    if (junk == std::string_view::npos) return stop;
    refuse(at + junk, "this is not UTF-8 text", "give a CSV file in UTF-8, plain or gzip");
    return nullptr;
  }

  const char* refuse_cell(std::size_t index, const char* at, const char* end, CellState state) {
    const std::string_view text = trimmed({at, static_cast<std::size_t>(end - at)});
    std::string what = "column " + std::string(columns_[index].name) + ": ";
    if (!text.empty()) what += in_quotes(text) + " ";
    what += describe(state);
    std::string remedy =
        "give a decimal number with a point, or leave the cell empty where there is no value";
    if (columns_[index].role == ColumnRole::kTime) remedy = "give the time of every row in seconds";
    refuse(at, std::move(what), std::move(remedy));
    return nullptr;
  }

  const char* refuse_time(const char* at, std::int64_t time_ns) {
    char now[kMaxNumberChars];
    char before[kMaxNumberChars];
    const std::string_view now_s(now, static_cast<std::size_t>(write_time(now, time_ns) - now));
    const std::string_view before_s(
        before, static_cast<std::size_t>(write_time(before, last_time_ns_) - before));
    refuse(at,
           "column t_s: " + std::string(now_s) + " s is not after " + std::string(before_s) +
               " s of the row before",
           "give the rows in order of time, each time once");
    return nullptr;
  }

  bool wrong_cell_count(const char* at) {
    const std::string_view row = lines_.line();
    std::size_t cells = 1;
    for (const char c : row) cells += c == ',' ? 1 : 0;
    refuse(at,
           "the row has " + std::to_string(cells) + " cells where the header names " +
               std::to_string(columns_.size()) + " columns",
           "give one cell for each column; cut off a last row that is not whole");
    return false;
  }

  void refuse_no_rows() {
    failed_ = error_at(info_.file, lines_.number() + 1, 1, "there are no rows",
                       "give a recording with rows of numbers after the column names");
  }

  void refuse(const char* at, std::string what, std::string remedy) {
    const auto column = static_cast<std::size_t>(at - lines_.line().data()) + 1;
    failed_ = error_at(info_.file, lines_.number(), column, std::move(what), std::move(remedy));
  }

  LineReader lines_;
  RecordingInfo info_;
  std::vector<Column> columns_;
  std::int64_t last_time_ns_ = INT64_MIN;
  std::size_t empty_line_ = 0;  // the first one; 0: none
  std::uint64_t rows_ = 0;
  std::optional<InputError> failed_;
};

}  // namespace

auto open_csv_recording(ByteSource source)
    -> std::expected<std::unique_ptr<RowSource>, InputError> {
  LineReader lines(std::move(source));
  auto header = read_table_header(lines, kRecordingFirstLine);
  if (!header) return std::unexpected{header.error()};
  auto map = map_columns(header->names);
  if (!map) {
    HeaderFault& fault = map.error();
    const bool whole = fault.index >= header->name_columns.size();
    return std::unexpected{error_at(lines.name(), header->line,
                                    whole ? 1 : header->name_columns[fault.index],
                                    std::move(fault.what), std::move(fault.remedy))};
  }
  RecordingInfo info{.file = lines.name(),
                     .metadata = std::move(header->metadata),
                     .columns = std::move(header->names),
                     .voltage_kind = map->voltage_kind,
                     .signals = map->signals,
                     .truths = map->truths};
  return std::make_unique<CsvRows>(std::move(lines), std::move(info), std::move(map->columns));
}

}  // namespace cutforce::hal::host
