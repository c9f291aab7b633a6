#include "firmware/parameter_table.hpp"

#include <bit>
#include <cstddef>

#include "firmware/machine_check.hpp"
#include "firmware/rating.hpp"

namespace cutforce::firmware {
namespace {

[[nodiscard]] constexpr bool within(std::array<float, 3> Parameter::*column) {
  return std::ranges::all_of(kParameters, [column](const Parameter& parameter) {
    for (std::size_t k = 0; k < parameter.size(); ++k) {
      if (!parameter.allows((parameter.*column)[k])) return false;
    }
    return true;
  });
}
static_assert(within(&Parameter::absent));
static_assert(within(&Parameter::lathe));

[[nodiscard]] constexpr bool keys_and_indices_are_unique() {
  for (std::size_t a = 0; a < kParameters.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      if (kParameters[a].key == kParameters[b].key) return false;
      if (kParameters[a].index == kParameters[b].index) return false;
    }
  }
  return true;
}
static_assert(keys_and_indices_are_unique());
static_assert(std::ranges::is_sorted(kParameters, {}, &Parameter::section));

[[nodiscard]] constexpr bool each_is_documented() {
  return std::ranges::all_of(kParameters, [](const Parameter& parameter) {
    return parameter.sentence.ends_with('.') && parameter.minimum < parameter.maximum &&
           (parameter.zero_means.empty() || parameter.absent[0] == 0.0F);
  });
}
static_assert(each_is_documented());

// Two machines that differ in every member are the same once the table has filled them: so it names
// every member, and no padding hides a new one.
[[nodiscard]] constexpr Machine machine_of_bytes(std::byte value) {
  std::array<std::byte, sizeof(Machine)> bytes{};
  bytes.fill(value);
  return std::bit_cast<Machine>(bytes);
}
[[nodiscard]] constexpr Machine filled(Machine machine) {
  for (const Parameter& parameter : kParameters) {
    for (std::size_t k = 0; k < parameter.size(); ++k)
      parameter.set(machine, k, parameter.lathe[k]);
  }
  return machine;
}
static_assert(filled(machine_of_bytes(std::byte{0})) == filled(machine_of_bytes(std::byte{1})));

// And each writes a member of its own.
[[nodiscard]] constexpr bool members_are_distinct() {
  for (const Parameter& written : kParameters) {
    Machine machine = machine_of_bytes(std::byte{0});
    for (std::size_t k = 0; k < written.size(); ++k) written.set(machine, k, 1.0F);
    for (const Parameter& read : kParameters) {
      const float expected = &read == &written ? 1.0F : 0.0F;
      for (std::size_t k = 0; k < read.size(); ++k) {
        if (read.get(machine, k) != expected) return false;
      }
    }
  }
  return true;
}
static_assert(members_are_distinct());

static_assert(check(default_machine()));
// The default machine leaves nothing to be derived.
static_assert(complete_from_rating(default_machine()).value() == default_machine());

[[nodiscard]] constexpr bool rules_name_parameters() {
  for (const MachineRule& rule : kMachineRules) {
    if (rule.keys[0].empty()) return false;
    for (std::size_t k = 0; k < rule.keys.size(); ++k) {
      if (!rule.keys[k].empty() && !find_parameter(rule.keys[k])) return false;
    }
  }
  return true;
}
static_assert(rules_name_parameters());

}  // namespace
}  // namespace cutforce::firmware
