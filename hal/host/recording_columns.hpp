// Which column of a recording is which value: INTERFACES.md section 1 as one table, for both the
// reader and the writer, text and binary.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hal/host/input_error.hpp"
#include "hal/host/truth.hpp"
#include "hal/host/voltage_kind.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::host {

// One `# key: value` line.
struct Metadata {
  std::string key;
  std::string value;
  std::size_t line;  // in the file as it was first read; 0: not from a file

  friend bool operator==(const Metadata&, const Metadata&) = default;
};

// All that a recording says before its rows.
struct RecordingInfo {
  std::string file;
  std::vector<Metadata> metadata;    // in order; a key may come twice
  std::vector<std::string> columns;  // in order, unknown ones too
  VoltageKind voltage_kind;
  std::uint32_t signals;  // bit(Signal) of each that has a column
  std::uint32_t truths;   // bit(TruthSignal) of each that has a column
};

enum class ColumnRole : std::uint8_t {
  kTime,
  kSample,  // a float of Sample
  kTruth,   // a float of Truth
  kIgnored,
};

// What a known column name stands for. Value in the record = number in the text / units_per_si.
struct Column {
  std::string_view name;
  ColumnRole role;
  std::uint8_t signal;   // of enum Signal or TruthSignal
  std::uint16_t offset;  // of the float in Sample or Truth
  double units_per_si;
};

// All known columns, in the order in which they are written.
[[nodiscard]] std::span<const Column> known_columns() noexcept;

[[nodiscard]] std::uint32_t bit(const Column& column) noexcept;

// Whether the name is a voltage's, and of which kind.
[[nodiscard]] std::optional<VoltageKind> voltage_kind_of(const Column& column) noexcept;

struct ColumnMap {
  std::vector<Column> columns;  // one for each name, in order
  VoltageKind voltage_kind;
  std::uint32_t signals;
  std::uint32_t truths;
};

// What is wrong with a header, at the name of this index (names.size(): at the header as a whole).
struct HeaderFault {
  std::size_t index;
  std::string what;
  std::string remedy;
};

// Fails iff a required column (time, three voltages of one kind, i_u_a, i_v_a) is missing, a known
// one comes twice (also in another unit), or both kinds of voltage are there.
[[nodiscard]] std::expected<ColumnMap, HeaderFault> map_columns(std::span<const std::string> names);

// The float of the column inside its record.
[[nodiscard]] inline std::byte* field(const Column& column, Sample& sample, Truth& truth) noexcept {
  return (column.role == ColumnRole::kSample ? reinterpret_cast<std::byte*>(&sample)
                                             : reinterpret_cast<std::byte*>(&truth)) +
         column.offset;
}
[[nodiscard]] inline const std::byte* field(const Column& column, const Sample& sample,
                                            const Truth& truth) noexcept {
  return (column.role == ColumnRole::kSample ? reinterpret_cast<const std::byte*>(&sample)
                                             : reinterpret_cast<const std::byte*>(&truth)) +
         column.offset;
}

}  // namespace cutforce::hal::host
