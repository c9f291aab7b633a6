// How the tables of scenario_table.hpp are written, for their two source files alone.
#pragma once

#include <type_traits>

#include "firmware/host/scenario/scenario_table.hpp"

// A lambda for one field of ScenarioConfigs; the type of the field picks the alternative.
#define CUTFORCE_AT(field) [](const ScenarioConfigs& s) -> decltype((s.field)) { return s.field; }

namespace cutforce::firmware::host::scenario_key {

[[nodiscard]] constexpr ScenarioKey number(std::string_view section, std::string_view key,
                                           std::string_view unit, float minimum, float maximum,
                                           std::string_view sentence, NumberAt at) {
  return {section, key, unit, minimum, maximum, sentence, at};
}
[[nodiscard]] constexpr ScenarioKey flag(std::string_view section, std::string_view key,
                                         std::string_view sentence, FlagAt at) {
  return {section, key, "", 0, 1, sentence, at};
}
[[nodiscard]] constexpr ScenarioKey profile(std::string_view section, std::string_view key,
                                            std::string_view unit, float minimum, float maximum,
                                            std::string_view over, std::string_view sentence,
                                            ProfileAt at) {
  return {section, key, unit, minimum, maximum, sentence, at, over};
}
[[nodiscard]] constexpr ScenarioKey channel(std::string_view section, std::string_view key,
                                            std::string_view unit, float minimum, float maximum,
                                            std::string_view sentence, ChannelAt at) {
  return {section, key, unit, minimum, maximum, sentence, at};
}
[[nodiscard]] constexpr ScenarioKey choice(std::string_view section, std::string_view key,
                                           std::string_view sentence, ChoiceAt at) {
  return {section, key, "", 0, 0, sentence, at};
}

template <class Field>
[[nodiscard]] constexpr ChoiceAt choice_at(std::span<const std::string_view> names, Field /*at*/) {
  using Enum = std::remove_reference_t<std::invoke_result_t<Field, const ScenarioConfigs&>>;
  return {names, [](const ScenarioConfigs& s) { return static_cast<std::size_t>(Field{}(s)); },
          [](const ScenarioConfigs& s, std::size_t k) { Field{}(s) = static_cast<Enum>(k); }};
}

// What both models have: the cut and the feed.
[[nodiscard]] std::span<const ScenarioKey> process_keys();
[[nodiscard]] std::span<const ScenarioKey> feed_keys();

[[nodiscard]] std::vector<ScenarioKey> motor_keys();
[[nodiscard]] std::span<const ScenarioSection> motor_sections();

inline void append(std::vector<ScenarioKey>& keys, std::span<const ScenarioKey> more) {
  keys.insert(keys.end(), more.begin(), more.end());
}

}  // namespace cutforce::firmware::host::scenario_key
