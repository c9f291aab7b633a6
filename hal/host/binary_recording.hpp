// A parsed recording as bytes (.cfr), version 1: what a CSV costs in parsing is paid once.
// Little endian throughout; every part ends in the CRC-32 (zlib's) of the part before it.
//
//   magic    89 43 46 52 45 43 0D 0A         not text, and damaged by any text-mode copy
//   header   u32 version, u32 bytes; bytes of: u32 metadata count, each (u64 line, text key, text
//            value); u32 column count, each (text name); u32 crc. A text is u32 length and UTF-8.
//   block    u32 rows (1..65536), u32 bytes; bytes of: i64 time_ns[rows]; then for each column but
//            the time a form, u8: 0 no row has a value, 1 all have, 2 some have; forms 1 and 2:
//            f32[rows]; form 2: bits[(rows + 7) / 8], lowest bit first, 1 where there is a value;
//            u32 crc
//   end      u32 0, u32 8, u64 rows of all blocks, u32 crc
//
// Columns bear their names in the text form, but values are those of hal::Sample, in SI units.
// Only known columns are kept. Memory is one block, whatever the length.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hal/host/byte_source.hpp"
#include "hal/host/output_file.hpp"
#include "hal/host/row_source.hpp"

namespace cutforce::hal::host {

inline constexpr std::string_view kBinaryMagic =
    "\x89"
    "CFREC\r\n";

// `source` stands after the magic. Fails iff it fails, ends early, is of another version, has a
// wrong CRC, or says what no recording may say (as map_columns).
[[nodiscard]] std::expected<std::unique_ptr<RowSource>, InputError> open_binary_recording(
    ByteSource source);

class BinaryRowsWriter {
 public:
  static constexpr std::size_t kRowsPerBlock = 4096;

  // `columns` begin with the time. Fails iff the file does.
  [[nodiscard]] static std::expected<BinaryRowsWriter, InputError> begin(
      OutputFile file, std::span<const Metadata> metadata, std::vector<Column> columns);

  [[nodiscard]] std::expected<void, InputError> write(const Sample& sample, const Truth& truth);
  [[nodiscard]] std::expected<void, InputError> finish();

 private:
  struct Values {
    std::vector<float> value;
    std::vector<std::uint8_t> present;  // a byte a row, packed when the block is written
  };

  BinaryRowsWriter(OutputFile file, std::vector<Column> columns);
  std::expected<void, InputError> write_block();

  OutputFile file_;
  std::vector<Column> columns_;  // without the time
  std::vector<std::int64_t> times_ns_;
  std::vector<Values> values_;  // one for each of columns_
  std::uint64_t rows_ = 0;
  std::string bytes_;
};

}  // namespace cutforce::hal::host
