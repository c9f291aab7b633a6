#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "hal/host/binary_bytes.hpp"
#include "hal/host/binary_recording.hpp"

namespace cutforce::hal::host {
namespace {

constexpr std::uint32_t kVersion = 1;

// The part's length, which was not known when the part was begun, and its CRC.
void close_part(std::string& part, std::size_t length_at) {
  const auto length = static_cast<std::uint32_t>(part.size() - length_at - sizeof(std::uint32_t));
  std::memcpy(part.data() + length_at, &length, sizeof length);
  put(part, crc_of(part));
}

std::string begin_part(std::uint32_t first) {
  std::string part;
  put(part, first);
  put(part, std::uint32_t{0});
  return part;
}
constexpr std::size_t kLengthAt = sizeof(std::uint32_t);

void put_bits(std::string& bytes, std::span<const std::uint8_t> flags) {
  for (std::size_t i = 0; i < flags.size(); i += 8) {
    unsigned packed = 0;
    for (std::size_t k = 0; k < std::min<std::size_t>(8, flags.size() - i); ++k) {
      packed |= static_cast<unsigned>(flags[i + k]) << k;
    }
    bytes += static_cast<char>(packed);
  }
}

template <class T>
void put_all(std::string& bytes, std::span<const T> values) {
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
}

}  // namespace

BinaryRowsWriter::BinaryRowsWriter(OutputFile file, std::vector<Column> columns)
    : file_(std::move(file)), columns_(std::move(columns)), values_(columns_.size()) {}

auto BinaryRowsWriter::begin(OutputFile file, std::span<const Metadata> metadata,
                             std::vector<Column> columns)
    -> std::expected<BinaryRowsWriter, InputError> {
  std::string header = begin_part(kVersion);
  put(header, static_cast<std::uint32_t>(metadata.size()));
  for (const Metadata& entry : metadata) {
    put(header, static_cast<std::uint64_t>(entry.line));
    put_text(header, entry.key);
    put_text(header, entry.value);
  }
  put(header, static_cast<std::uint32_t>(columns.size()));
  for (const Column& column : columns) put_text(header, column.name);
  close_part(header, kLengthAt);

  columns.erase(columns.begin());
  BinaryRowsWriter writer(std::move(file), std::move(columns));
  if (auto written = writer.file_.write(kBinaryMagic); !written) {
    return std::unexpected{written.error()};
  }
  if (auto written = writer.file_.write(header); !written) return std::unexpected{written.error()};
  return writer;
}

auto BinaryRowsWriter::write(const Sample& sample, const Truth& truth)
    -> std::expected<void, InputError> {
  times_ns_.push_back(sample.time_ns);
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const Column& column = columns_[i];
    float value = 0.0F;
    std::memcpy(&value, field(column, sample, truth), sizeof value);
    const std::uint32_t present =
        column.role == ColumnRole::kSample ? sample.present : truth.present;
    const bool there = (present & bit(column)) != 0 && std::isfinite(value);
    values_[i].value.push_back(there ? value : 0.0F);
    values_[i].present.push_back(there ? 1 : 0);
  }
  return times_ns_.size() == kRowsPerBlock ? write_block() : std::expected<void, InputError>{};
}

auto BinaryRowsWriter::write_block() -> std::expected<void, InputError> {
  bytes_ = begin_part(static_cast<std::uint32_t>(times_ns_.size()));
  put_all<std::int64_t>(bytes_, times_ns_);
  for (Values& values : values_) {
    const auto there = std::count(values.present.begin(), values.present.end(), 1);
    const bool all = static_cast<std::size_t>(there) == times_ns_.size();
    bytes_ += static_cast<char>(there == 0 ? 0 : all ? 1 : 2);
    if (there != 0) put_all<float>(bytes_, values.value);
    if (there != 0 && !all) put_bits(bytes_, values.present);
    values.value.clear();
    values.present.clear();
  }
  close_part(bytes_, kLengthAt);
  rows_ += times_ns_.size();
  times_ns_.clear();
  return file_.write(bytes_);
}

auto BinaryRowsWriter::finish() -> std::expected<void, InputError> {
  if (!times_ns_.empty()) {
    if (auto written = write_block(); !written) return written;
  }
  bytes_ = begin_part(0);
  put(bytes_, rows_);
  close_part(bytes_, kLengthAt);
  if (auto written = file_.write(bytes_); !written) return written;
  return file_.finish();
}

}  // namespace cutforce::hal::host
