// How a row of the table of parameters is written: by the member that it fills, so that key, type
// and place cannot disagree.
#pragma once

#include <string_view>

#include "firmware/parameter.hpp"

namespace cutforce::firmware {
namespace detail {

// Not constexpr: reaching it stops the compilation.
void the_key_is_not_the_members_name();

template <auto kMember>
[[nodiscard]] constexpr bool names_member(std::string_view key) noexcept {
  constexpr std::string_view kText = __PRETTY_FUNCTION__;
  const std::string_view tail = kText.substr(kText.find("Machine::") + 9);
  return tail.starts_with(key) && (tail[key.size()] == ']' || tail[key.size()] == ';');
}

struct Range {
  float minimum;
  float maximum;
};

template <auto kMember>
[[nodiscard]] consteval Parameter describe(std::uint16_t index, std::string_view key, Kind kind,
                                           std::string_view unit, Range range,
                                           std::array<float, 3> absent, std::array<float, 3> lathe,
                                           Write write, std::string_view sentence,
                                           std::string_view zero_means,
                                           std::span<const std::string_view> names) {
  if (!names_member<kMember>(key)) the_key_is_not_the_members_name();
  return {.index = index,
          .section = static_cast<Section>((index >> 8) - 1),
          .kind = kind,
          .key = key,
          .unit = unit,
          .minimum = range.minimum,
          .maximum = range.maximum,
          .zero_means = zero_means,
          .absent = absent,
          .lathe = lathe,
          .write = write,
          .sentence = sentence,
          .names = names,
          .get = &get<kMember>,
          .set = &set<kMember>};
}

template <auto kMember>
[[nodiscard]] consteval Parameter number(std::uint16_t index, std::string_view key,
                                         std::string_view unit, Range range, float absent,
                                         float lathe, Write write, std::string_view sentence,
                                         std::string_view zero_means = {}) {
  return describe<kMember>(index, key, Kind::kNumber, unit, range, {absent}, {lathe}, write,
                           sentence, zero_means, {});
}

template <auto kMember>
[[nodiscard]] consteval Parameter whole(std::uint16_t index, std::string_view key, Range range,
                                        float absent, float lathe, Write write,
                                        std::string_view sentence) {
  return describe<kMember>(index, key, Kind::kWhole, "", range, {absent}, {lathe}, write, sentence,
                           {}, {});
}

template <auto kMember>
[[nodiscard]] consteval Parameter triple(std::uint16_t index, std::string_view key,
                                         std::string_view unit, Range range,
                                         std::array<float, 3> absent, std::array<float, 3> lathe,
                                         Write write, std::string_view sentence) {
  return describe<kMember>(index, key, Kind::kTriple, unit, range, absent, lathe, write, sentence,
                           {}, {});
}

template <auto kMember>
[[nodiscard]] consteval Parameter flag(std::uint16_t index, std::string_view key, bool absent,
                                       bool lathe, Write write, std::string_view sentence) {
  return describe<kMember>(index, key, Kind::kFlag, "", {0.0F, 1.0F}, {absent ? 1.0F : 0.0F},
                           {lathe ? 1.0F : 0.0F}, write, sentence, {}, {});
}

template <auto kMember>
[[nodiscard]] consteval Parameter choice(std::uint16_t index, std::string_view key,
                                         MemberType<kMember> absent, MemberType<kMember> lathe,
                                         Write write, std::string_view sentence) {
  const auto names = kNames<MemberType<kMember>>;
  return describe<kMember>(
      index, key, Kind::kChoice, "", {0.0F, static_cast<float>(names.size() - 1)},
      {static_cast<float>(absent)}, {static_cast<float>(lathe)}, write, sentence, {}, names);
}

inline constexpr std::string_view kDerived = "derived from the rating";

}  // namespace detail
}  // namespace cutforce::firmware
