// Fields of a frame: where the bits of a value are and what its codes mean. The one place that
// shifts and rounds; layout.hpp says which fields a message has.
//
//   value = (code + offset) * units / steps        in float, by one multiplication and one division
//
// Units and steps are whole numbers, so every code up to 2^20 has a value of its own that leads
// back to it. A value is rounded to the nearest code, halves away from zero, and held to the codes
// that the field allows. What is not a number is not known; where a field has no code for that, it
// has the lowest one.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <type_traits>

#include "hal/can/frame.hpp"

namespace cutforce::hal::can {

struct Field {
  static constexpr std::int32_t kNoCode = INT32_MIN;

  unsigned first;  // bit n is bit n % 8 of byte n / 8: the order that DBC files call Intel
  unsigned bits;   // at most 31
  bool is_signed;
  bool wraps;            // a counter: the low bits of the value, whatever it is
  std::int32_t minimum;  // codes of known values
  std::int32_t maximum;
  std::int32_t absent;  // code of the value that is not known, or kNoCode
  float offset;
  float units;
  float steps;

  [[nodiscard]] constexpr Field scaled(float by_units, float by_steps,
                                       float by_offset = 0.0F) const noexcept {
    Field field = *this;
    field.units = by_units;
    field.steps = by_steps;
    field.offset = by_offset;
    return field;
  }
  // The code is the lowest or the highest of the field.
  [[nodiscard]] constexpr Field without(std::int32_t code) const noexcept {
    Field field = *this;
    field.absent = code;
    if (code == minimum) ++field.minimum;
    if (code == maximum) --field.maximum;
    return field;
  }
  [[nodiscard]] constexpr Field up_to(std::int32_t code) const noexcept {
    Field field = *this;
    field.maximum = code;
    return field;
  }
  [[nodiscard]] constexpr Field wrapping() const noexcept {
    Field field = *this;
    field.wraps = true;
    return field;
  }
  // Each code is its value.
  [[nodiscard]] constexpr bool is_whole() const noexcept {
    return std::bit_cast<std::uint32_t>(offset) == 0 && units <= steps && units >= steps;
  }
};

[[nodiscard]] constexpr std::uint32_t low_mask(unsigned bits) noexcept {
  return (std::uint32_t{1} << bits) - 1U;
}
[[nodiscard]] constexpr Field unsigned_field(unsigned first, unsigned bits) noexcept {
  return {.first = first,
          .bits = bits,
          .is_signed = false,
          .wraps = false,
          .minimum = 0,
          .maximum = static_cast<std::int32_t>(low_mask(bits)),
          .absent = Field::kNoCode,
          .offset = 0.0F,
          .units = 1.0F,
          .steps = 1.0F};
}
[[nodiscard]] constexpr Field signed_field(unsigned first, unsigned bits) noexcept {
  Field field = unsigned_field(first, bits);
  field.is_signed = true;
  field.maximum = static_cast<std::int32_t>(low_mask(bits - 1));
  field.minimum = -field.maximum - 1;
  return field;
}
[[nodiscard]] constexpr Field flag(unsigned bit) noexcept { return unsigned_field(bit, 1); }

// The same without a float, of a field whose codes are the values.
[[nodiscard]] constexpr std::uint32_t whole_code_of(const Field& field,
                                                    std::uint32_t value) noexcept {
  const auto maximum = static_cast<std::uint32_t>(field.maximum);
  const auto minimum = static_cast<std::uint32_t>(std::max<std::int32_t>(field.minimum, 0));
  return std::clamp(value, minimum, maximum);
}

// The nearest code that the field allows; nothing for what is not a number.
[[nodiscard]] constexpr std::optional<std::int32_t> code_of(const Field& field,
                                                            float value) noexcept {
  const float exact = value * field.steps / field.units - field.offset;
  if (!(exact > static_cast<float>(field.minimum))) {
    if (value != value) return std::nullopt;
    return field.minimum;
  }
  if (!(exact < static_cast<float>(field.maximum))) return field.maximum;
  const auto whole = static_cast<std::int32_t>(exact);
  const float rest = exact - static_cast<float>(whole);
  if (field.minimum >= 0) return whole + (rest >= 0.5F ? 1 : 0);
  return whole + (rest >= 0.5F ? 1 : 0) - (rest <= -0.5F ? 1 : 0);
}

[[nodiscard]] constexpr float value_of(const Field& field, std::int32_t code) noexcept {
  return (static_cast<float>(code) + field.offset) * field.units / field.steps;
}

class FieldWriter {
 public:
  template <class Value>
  requires std::is_arithmetic_v<Value>
  constexpr void operator()(const Field& field, const Value& value) noexcept {
    if constexpr (std::unsigned_integral<Value>) {
      if (field.wraps) return put(field, static_cast<std::uint32_t>(value));
      if (field.is_whole()) return put(field, whole_code_of(field, value));
    }
    put_code(field, code_of(field, static_cast<float>(value)));
  }
  template <class Value>
  constexpr void operator()(const Field& field, const std::optional<Value>& value) noexcept {
    if (value) return (*this)(field, *value);
    put_code(field, std::nullopt);
  }

  [[nodiscard]] constexpr std::uint64_t word() const noexcept { return word_; }
  [[nodiscard]] constexpr std::array<std::uint8_t, 8> bytes() const noexcept {
    return bytes_of(word_);
  }

 private:
  constexpr void put_code(const Field& field, std::optional<std::int32_t> code) noexcept {
    const std::int32_t unknown = field.absent != Field::kNoCode ? field.absent : field.minimum;
    put(field, static_cast<std::uint32_t>(code.value_or(unknown)));
  }
  constexpr void put(const Field& field, std::uint32_t code) noexcept {
    word_ |= static_cast<std::uint64_t>(code & low_mask(field.bits)) << field.first;
  }

  std::uint64_t word_ = 0;
};

class FieldReader {
 public:
  explicit constexpr FieldReader(const std::array<std::uint8_t, 8>& bytes) noexcept
      : word_(word_of(bytes)) {}

  template <class Value>
  requires std::is_arithmetic_v<Value>
  constexpr void operator()(const Field& field, Value& value) noexcept {
    take(field, code_at(field), value);
  }
  template <class Value>
  constexpr void operator()(const Field& field, std::optional<Value>& value) noexcept {
    const std::int32_t code = code_at(field);
    value.reset();
    if (code == field.absent) return;
    take(field, code, value.emplace());
  }

  // Every code so far was one that its field allows.
  [[nodiscard]] constexpr bool in_range() const noexcept { return in_range_; }

 private:
  [[nodiscard]] constexpr std::int32_t code_at(const Field& field) const noexcept {
    const auto code = static_cast<std::uint32_t>(word_ >> field.first) & low_mask(field.bits);
    const bool negative = field.is_signed && (code >> (field.bits - 1)) != 0;
    return static_cast<std::int32_t>(negative ? code | ~low_mask(field.bits) : code);
  }
  template <class Value>
  constexpr void take(const Field& field, std::int32_t code, Value& value) noexcept {
    in_range_ = in_range_ && code >= field.minimum && code <= field.maximum;
    const std::int32_t held = std::clamp(code, field.minimum, field.maximum);
    if (field.is_whole()) {
      value = static_cast<Value>(held);
    } else {
      value = static_cast<Value>(value_of(field, held));
    }
  }

  std::uint64_t word_;
  bool in_range_ = true;
};

}  // namespace cutforce::hal::can
