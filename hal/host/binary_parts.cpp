#include "hal/host/binary_parts.hpp"

#include <cstring>
#include <span>
#include <utility>

#include "hal/host/binary_bytes.hpp"

namespace cutforce::hal::host {
namespace {

constexpr std::size_t kPrefixBytes = 2 * sizeof(std::uint32_t);
constexpr std::size_t kCrcBytes = sizeof(std::uint32_t);

}  // namespace

BinaryParts::BinaryParts(ByteSource source, std::uint64_t offset)
    : source_(std::move(source)), offset_(offset), part_at_(offset) {}

auto BinaryParts::next(std::uint32_t max_body_bytes) -> std::expected<BinaryPart, InputError> {
  part_at_ = offset_;
  buffer_.resize(kPrefixBytes);
  if (auto got = take(0); !got) return std::unexpected{got.error()};
  const auto first = number_at(0);
  const auto length = number_at(sizeof(std::uint32_t));
  if (length > max_body_bytes) return refused("the length of a part is damaged");
  buffer_.resize(kPrefixBytes + length + kCrcBytes);
  if (auto got = take(kPrefixBytes); !got) return std::unexpected{got.error()};
  const std::string_view checked(buffer_.data(), kPrefixBytes + length);
  if (crc_of(checked) != number_at(checked.size())) return refused("the check sum is wrong");
  return BinaryPart{.first = first, .body = checked.substr(kPrefixBytes)};
}

auto BinaryParts::end() -> std::expected<void, InputError> {
  char more = 0;
  const auto count = source_.read(std::span(&more, 1));
  if (!count) return refused(count.error().what, count.error().remedy);
  if (*count != 0) return refused("something follows the end", "cut off what follows the end");
  return {};
}

std::unexpected<InputError> BinaryParts::refused(std::string what, std::string remedy) const {
  return std::unexpected{InputError{.where = name() + ":byte " + std::to_string(part_at_),
                                    .what = std::move(what),
                                    .remedy = std::move(remedy)}};
}

// Fills the buffer from this index on.
std::expected<void, InputError> BinaryParts::take(std::size_t from) {
  while (from < buffer_.size()) {
    const auto count = source_.read(std::span(buffer_).subspan(from));
    if (!count) return refused(count.error().what, count.error().remedy);
    if (*count == 0) return refused("the file ends before its end mark");
    from += *count;
    offset_ += *count;
  }
  return {};
}

std::uint32_t BinaryParts::number_at(std::size_t index) const {
  std::uint32_t value = 0;
  std::memcpy(&value, buffer_.data() + index, sizeof value);
  return value;
}

}  // namespace cutforce::hal::host
