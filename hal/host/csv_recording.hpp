// A recording as text: the first line, the metadata, the header, then one row a line.
#pragma once

#include <expected>
#include <memory>
#include <string>
#include <string_view>

#include "hal/host/byte_source.hpp"
#include "hal/host/row_source.hpp"

namespace cutforce::hal::host {

inline constexpr std::string_view kRecordingFirstLine = "# cutforce recording 1";

// Fails iff the source does, or what stands before the rows is not that of a recording.
[[nodiscard]] std::expected<std::unique_ptr<RowSource>, InputError> open_csv_recording(
    ByteSource source);

}  // namespace cutforce::hal::host
