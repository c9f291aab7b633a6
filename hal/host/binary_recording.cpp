#include "hal/host/binary_recording.hpp"

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include "hal/host/binary_bytes.hpp"
#include "hal/host/binary_parts.hpp"
#include "hal/host/number_text.hpp"
#include "hal/host/plain_text.hpp"

namespace cutforce::hal::host {
namespace {

constexpr std::uint32_t kVersion = 1;
constexpr std::uint32_t kMaxRows = 65536;
constexpr std::uint32_t kMaxHeaderBytes = std::uint32_t{16}
                                          << 20U;  // a damaged length asks no more

// The values of one column in the current block.
struct Values {
  const char* value = nullptr;    // float[rows], unaligned; null: no row has a value
  const char* present = nullptr;  // bits; null: every row has a value
};

class BinaryRows final : public RowSource {
 public:
  BinaryRows(BinaryParts parts, RecordingInfo info, std::vector<Column> columns)
      : parts_(std::move(parts)),
        info_(std::move(info)),
        columns_(std::move(columns)),
        values_(columns_.size()) {}

  [[nodiscard]] const RecordingInfo& info() const noexcept override { return info_; }

  std::expected<std::size_t, InputError> read(std::span<Sample> samples,
                                              std::span<Truth> truths) override {
    std::size_t count = 0;
    while (count < samples.size() && !ended_ && !failed_) {
      if (row_ == rows_) {
        if (auto got = next_block(); !got) failed_ = std::move(got.error());
        continue;
      }
      const std::size_t rows = std::min(rows_ - row_, samples.size() - count);
      copy_rows(samples.subspan(count, rows), truths.subspan(count, rows));
      count += rows;
      row_ += rows;
    }
    if (count == 0 && failed_) return std::unexpected{*failed_};
    return count;
  }

 private:
  std::expected<void, InputError> next_block() {
    const auto part = parts_.next(max_block_bytes());
    if (!part) return std::unexpected{part.error()};
    if (part->first == 0) return end(part->body);
    if (part->first > kMaxRows) return parts_.refused("a block has too many rows");
    row_ = 0;
    rows_ = part->first;
    total_ += rows_;
    if (!index_block(part->body)) {
      rows_ = 0;
      return parts_.refused("the length of a block is wrong");
    }
    return check_block();
  }

  std::expected<void, InputError> end(std::string_view body) {
    const auto total = Taker(body).number<std::uint64_t>();
    if (!total || *total != total_) return parts_.refused("rows are missing before the end");
    if (total_ == 0) return parts_.refused("there are no rows", "give a recording with rows");
    ended_ = true;
    return parts_.end();
  }

  [[nodiscard]] std::uint32_t max_block_bytes() const {
    constexpr std::uint32_t kBytesPerValue = sizeof(float) + 1;
    return kMaxRows * (static_cast<std::uint32_t>(sizeof(std::int64_t)) +
                       static_cast<std::uint32_t>(columns_.size()) * kBytesPerValue);
  }

  // False where the body is not as long as it says.
  bool index_block(std::string_view body) {
    Taker taker(body);
    const auto times = taker.bytes(rows_ * sizeof(std::int64_t));
    if (!times) return false;
    times_ = times->data();
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      values_[i] = {};
      if (columns_[i].role == ColumnRole::kTime) continue;
      const auto form = taker.number<std::uint8_t>();
      if (!form || *form > 2) return false;
      if (*form == 0) continue;
      const auto value = taker.bytes(rows_ * sizeof(float));
      if (!value) return false;
      values_[i].value = value->data();
      if (*form == 1) continue;
      const auto present = taker.bytes((rows_ + 7) / 8);
      if (!present) return false;
      values_[i].present = present->data();
    }
    return taker.done();
  }

  // The check sum tells damage; this tells a writer that does not keep to the format.
  std::expected<void, InputError> check_block() {
    for (std::size_t row = 0; row < rows_; ++row) {
      std::int64_t time_ns = 0;
      std::memcpy(&time_ns, times_ + row * sizeof time_ns, sizeof time_ns);
      if (time_ns <= last_time_ns_ || time_ns > kMaxTimeNs || time_ns < -kMaxTimeNs) {
        return refuse_block("the time does not increase from row to row");
      }
      last_time_ns_ = time_ns;
    }
    for (const Values& values : values_) {
      std::uint32_t not_finite = 0;
      for (std::size_t row = 0; values.value != nullptr && row < rows_; ++row) {
        constexpr std::uint32_t kExponent = 0x7F80'0000;
        std::uint32_t bits = 0;
        std::memcpy(&bits, values.value + row * sizeof bits, sizeof bits);
        not_finite |= (bits & kExponent) == kExponent ? 1U : 0U;
      }
      if (not_finite != 0) return refuse_block("a value is not a finite number");
    }
    return {};
  }

  std::expected<void, InputError> refuse_block(std::string what) {
    rows_ = row_ = 0;
    return parts_.refused(std::move(what));
  }

  void copy_rows(std::span<Sample> samples, std::span<Truth> truths) const {
    for (std::size_t i = 0; i < samples.size(); ++i) {
      samples[i] = Sample{};
      truths[i] = Truth{};
      std::memcpy(&samples[i].time_ns, times_ + (row_ + i) * sizeof(std::int64_t),
                  sizeof(std::int64_t));
    }
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (values_[i].value == nullptr) continue;
      if (columns_[i].role == ColumnRole::kSample) {
        copy_column(columns_[i], values_[i], samples);
      } else if (columns_[i].role == ColumnRole::kTruth) {
        copy_column(columns_[i], values_[i], truths);
      }
    }
  }

  template <class Record>
  void copy_column(const Column& column, const Values& values, std::span<Record> records) const {
    for (std::size_t i = 0; i < records.size(); ++i) {
      const std::size_t row = row_ + i;
      if (values.present != nullptr &&
          (static_cast<unsigned char>(values.present[row / 8]) >> (row % 8) & 1U) == 0) {
        continue;
      }
      std::memcpy(reinterpret_cast<std::byte*>(&records[i]) + column.offset,
                  values.value + row * sizeof(float), sizeof(float));
      records[i].present |= bit(column);
    }
  }

  BinaryParts parts_;
  RecordingInfo info_;
  std::vector<Column> columns_;
  std::vector<Values> values_;  // one for each column
  const char* times_ = nullptr;
  std::size_t row_ = 0;
  std::size_t rows_ = 0;
  std::uint64_t total_ = 0;
  std::int64_t last_time_ns_ = INT64_MIN;
  bool ended_ = false;
  std::optional<InputError> failed_;
};

// False where the header is shorter or longer than it says, or holds what is no text.
bool read_header(std::string_view body, RecordingInfo& info) {
  Taker taker(body);
  const auto is_text = [](std::string_view text) {
    return find_non_text(text) == std::string_view::npos;
  };
  const auto entries = taker.number<std::uint32_t>();
  for (std::uint32_t i = 0; entries && i < *entries; ++i) {
    const auto line = taker.number<std::uint64_t>();
    const auto key = taker.text();
    const auto value = taker.text();
    if (!line || !key || !value || !is_text(*key) || !is_text(*value)) return false;
    info.metadata.push_back({std::string(*key), std::string(*value), *line});
  }
  const auto names = taker.number<std::uint32_t>();
  for (std::uint32_t i = 0; names && i < *names; ++i) {
    const auto name = taker.text();
    if (!name || !is_text(*name)) return false;
    info.columns.emplace_back(*name);
  }
  return entries && names && taker.done();
}

}  // namespace

auto open_binary_recording(ByteSource source)
    -> std::expected<std::unique_ptr<RowSource>, InputError> {
  constexpr std::size_t kMaxColumns = 256;
  BinaryParts parts(std::move(source), kBinaryMagic.size());
  const auto part = parts.next(kMaxHeaderBytes);
  if (!part) return std::unexpected{part.error()};
  if (part->first != kVersion) {
    return parts.refused("version " + std::to_string(part->first) + " is not known",
                         "make the file again with this program");
  }
  RecordingInfo info{.file = parts.name(),
                     .metadata = {},
                     .columns = {},
                     .voltage_kind = VoltageKind::kLineToNeutral,
                     .signals = 0,
                     .truths = 0};
  if (!read_header(part->body, info) || info.columns.size() > kMaxColumns) {
    return parts.refused("the header does not keep to the format");
  }
  auto map = map_columns(info.columns);
  if (!map) return parts.refused(std::move(map.error().what), std::move(map.error().remedy));
  info.voltage_kind = map->voltage_kind;
  info.signals = map->signals;
  info.truths = map->truths;
  return std::make_unique<BinaryRows>(std::move(parts), std::move(info), std::move(map->columns));
}

}  // namespace cutforce::hal::host
