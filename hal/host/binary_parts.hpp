// The parts that a binary recording consists of: u32, u32 length, body, u32 CRC-32 of all before.
// Memory is one part, and no part is believed to be longer than the caller allows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <string>
#include <string_view>
#include <vector>

#include "hal/host/byte_source.hpp"
#include "hal/host/input_error.hpp"

namespace cutforce::hal::host {

struct BinaryPart {
  std::uint32_t first;    // version, or rows
  std::string_view body;  // valid until the next part
};

class BinaryParts {
 public:
  static constexpr const char* kMakeAgain = "make the file again from the CSV recording";

  // `source` stands `offset` bytes after the file's begin.
  BinaryParts(ByteSource source, std::uint64_t offset);

  // Fails iff the source does or ends, the part is longer than allowed, or its CRC is wrong.
  [[nodiscard]] std::expected<BinaryPart, InputError> next(std::uint32_t max_body_bytes);

  // Fails iff anything follows.
  [[nodiscard]] std::expected<void, InputError> end();

  // An error at the begin of the part that was read last.
  [[nodiscard]] std::unexpected<InputError> refused(std::string what,
                                                    std::string remedy = kMakeAgain) const;

  [[nodiscard]] const std::string& name() const noexcept { return source_.name(); }

 private:
  std::expected<void, InputError> take(std::size_t from);
  [[nodiscard]] std::uint32_t number_at(std::size_t index) const;

  ByteSource source_;
  std::vector<char> buffer_;
  std::uint64_t offset_;
  std::uint64_t part_at_;
};

}  // namespace cutforce::hal::host
