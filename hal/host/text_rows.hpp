// Rows of comma-separated cells into an output file, formatted in one fixed buffer.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <expected>
#include <string_view>
#include <utility>
#include <vector>

#include "hal/host/input_error.hpp"
#include "hal/host/number_text.hpp"
#include "hal/host/output_file.hpp"

namespace cutforce::hal::host {

class TextRows {
 public:
  // No row is longer than `max_row_bytes`, ends and commas included.
  TextRows(OutputFile file, std::size_t max_row_bytes)
      : file_(std::move(file)), buffer_(kBufferBytes + max_row_bytes), at_(buffer_.data()) {}

  // A line as it is, of any length; only between rows.
  [[nodiscard]] std::expected<void, InputError> line(std::string_view text) {
    if (auto flushed = flush(); !flushed) return flushed;
    if (auto written = file_.write(text); !written) return written;
    return file_.write(std::string_view("\n"));
  }

  void time(std::int64_t time_ns) noexcept { end_cell(write_time(at_, time_ns)); }

  // Empty where the value is not finite: a table holds what exists, and no NaN.
  template <class T>
  void number(T value) noexcept {
    end_cell(std::isfinite(value) ? write_number(at_, value) : at_);
  }
  void text(std::string_view cell) noexcept {
    std::memcpy(at_, cell.data(), cell.size());
    end_cell(at_ + cell.size());
  }
  void empty() noexcept { end_cell(at_); }

  // Fails iff the file does.
  [[nodiscard]] std::expected<void, InputError> end_row() {
    at_[-1] = '\n';  // in place of the last cell's comma
    const auto used = static_cast<std::size_t>(at_ - buffer_.data());
    return used >= kBufferBytes ? flush() : std::expected<void, InputError>{};
  }

  [[nodiscard]] std::expected<void, InputError> finish() {
    if (auto flushed = flush(); !flushed) return flushed;
    return file_.finish();
  }

 private:
  static constexpr std::size_t kBufferBytes = std::size_t{64} * 1024;

  void end_cell(char* end) noexcept {
    *end = ',';
    at_ = end + 1;
  }

  std::expected<void, InputError> flush() {
    const std::string_view bytes(buffer_.data(), static_cast<std::size_t>(at_ - buffer_.data()));
    at_ = buffer_.data();
    return bytes.empty() ? std::expected<void, InputError>{} : file_.write(bytes);
  }

  OutputFile file_;
  std::vector<char> buffer_;
  char* at_;
};

}  // namespace cutforce::hal::host
