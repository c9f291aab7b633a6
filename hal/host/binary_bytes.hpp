// Little-endian numbers and texts in a run of bytes: the alphabet of the binary recording.
#pragma once

#include <zlib.h>

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

namespace cutforce::hal::host {

static_assert(std::endian::native == std::endian::little, "the binary form is little endian");

template <class T>
void put(std::string& bytes, T value) {
  static_assert(std::is_arithmetic_v<T>);
  const std::size_t at = bytes.size();
  bytes.resize(at + sizeof value);
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

inline void put_text(std::string& bytes, std::string_view text) {
  put(bytes, static_cast<std::uint32_t>(text.size()));
  bytes += text;
}

[[nodiscard]] inline std::uint32_t crc_of(std::string_view bytes) noexcept {
  return static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

// Takes from the front of the bytes it is given; empty once they do not suffice.
class Taker {
 public:
  explicit Taker(std::string_view bytes) noexcept : rest_(bytes) {}

  [[nodiscard]] std::optional<std::string_view> bytes(std::size_t count) noexcept {
    if (count > rest_.size()) return std::nullopt;
    const std::string_view taken = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return taken;
  }

  template <class T>
  [[nodiscard]] std::optional<T> number() noexcept {
    const auto taken = bytes(sizeof(T));
    if (!taken) return std::nullopt;
    T value{};
    std::memcpy(&value, taken->data(), sizeof value);
    return value;
  }

  [[nodiscard]] std::optional<std::string_view> text() noexcept {
    const auto length = number<std::uint32_t>();
    return length ? bytes(*length) : std::nullopt;
  }

  [[nodiscard]] bool done() const noexcept { return rest_.empty(); }

 private:
  std::string_view rest_;
};

}  // namespace cutforce::hal::host
