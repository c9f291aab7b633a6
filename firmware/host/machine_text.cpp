// The third part of machine_file.hpp: the table as a commented file and as a page.
#include <algorithm>
#include <array>
#include <string>

#include "firmware/host/machine_file.hpp"
#include "firmware/host/number_text.hpp"
#include "firmware/host/toml_check.hpp"

namespace cutforce::firmware::host {
namespace {

constexpr std::size_t kWidth = 96;

constexpr auto kSectionSentences = std::to_array<std::string_view>(
    {"What the sensors deliver.", "The motor, from its name plate and from measurement.",
     "Friction of motor and spindle, seen from the motor.", "From the motor to the cut.",
     "The drive's own power output.", "How the cutting force is estimated.",
     "How the feed override is set.", "Who may move the feed, and when nobody may."});
static_assert(kSectionSentences.size() == kSectionNames.size());

std::string value_text(const Parameter& parameter, float value) {
  if (parameter.kind == Kind::kFlag) return value != 0.0F ? "true" : "false";
  if (parameter.kind == Kind::kChoice) {
    return "\"" + std::string(parameter.names[static_cast<std::size_t>(value)]) + "\"";
  }
  return number_text(value);
}

template <class Get>
std::string values_text(const Parameter& parameter, const Get& get) {
  if (parameter.kind != Kind::kTriple) return value_text(parameter, get(0));
  return "[" + number_text(get(0)) + ", " + number_text(get(1)) + ", " + number_text(get(2)) + "]";
}

std::string allowed_text(const Parameter& parameter, std::string_view separator) {
  if (parameter.kind == Kind::kFlag) return "true or false";
  if (parameter.kind == Kind::kChoice) {
    std::string text;
    for (const std::string_view name : parameter.names) {
      text += (text.empty() ? "" : std::string(separator)) + "\"" + std::string(name) + "\"";
    }
    return text;
  }
  return range_text({.minimum = parameter.minimum,
                     .maximum = parameter.maximum,
                     .unit = parameter.unit,
                     .zero_means = parameter.zero_means,
                     .whole = parameter.kind == Kind::kWhole});
}

std::string absent_text(const Parameter& parameter) {
  if (parameter.key == "pole_pairs") return "must be given";
  if (!parameter.zero_means.empty()) return "if left out: " + std::string(parameter.zero_means);
  return "if left out: " +
         values_text(parameter, [&](std::size_t k) { return parameter.absent[k]; });
}

std::string commented(std::string_view text) {
  std::string result;
  std::string line = "#";
  while (!text.empty()) {
    const std::string_view word = text.substr(0, text.find(' '));
    text.remove_prefix(std::min(text.size(), word.size() + 1));
    if (line.size() + 1 + word.size() > kWidth) {
      result += line + "\n";
      line = "#";
    }
    line += " " + std::string(word);
  }
  return result + line + "\n";
}

std::string hexadecimal(std::uint16_t value) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text = "0x";
  for (unsigned shift = 16; shift > 0; shift -= 4) {
    text += kDigits[std::uint32_t{value} >> (shift - 4) & 0xFU];
  }
  return text;
}

}  // namespace

std::string machine_file_text(const Machine& machine) {
  std::string text =
      "# A machine for cutforce. SI units, each named at the end of its key. What is left out is\n"
      "# taken from the recording, then from the rating, then from the value named with the key.\n";
  std::string_view section;
  for (const Parameter& parameter : kParameters) {
    if (name_of(parameter.section) != section) {
      section = name_of(parameter.section);
      text += "\n# " + std::string(kSectionSentences[static_cast<std::size_t>(parameter.section)]) +
              "\n[" + std::string(section) + "]\n";
    }
    text += "\n" + commented(parameter.sentence);
    text += commented(allowed_text(parameter, ", ") + "; " + absent_text(parameter));
    text += std::string(parameter.key) + " = " +
            values_text(parameter, [&](std::size_t k) { return parameter.get(machine, k); }) + "\n";
  }
  return text;
}

std::string parameter_page() {
  std::string text =
      "# Parameters\n\nWritten by the program from its own table "
      "(`firmware/parameter_table.hpp`).\n"
      "A machine file is TOML; `default lathe` is the machine of `cutforce demo`. A running "
      "machine\n"
      "takes a new value at: construction (before the loop is made), idle (out of the cut), any "
      "time.\n";
  std::string_view section;
  for (const Parameter& parameter : kParameters) {
    if (name_of(parameter.section) != section) {
      section = name_of(parameter.section);
      text += "\n## [" + std::string(section) + "]\n\n" +
              std::string(kSectionSentences[static_cast<std::size_t>(parameter.section)]) +
              "\n\n| key | meaning | allowed | left out | default lathe | new value | CAN index |\n"
              "|---|---|---|---|---|---|---|\n";
    }
    std::string absent = absent_text(parameter);
    if (absent.starts_with("if left out: ")) absent.erase(0, 13);
    text += "| `" + std::string(parameter.key) + "` | " + std::string(parameter.sentence) + " | " +
            allowed_text(parameter, ", ") + " | " + absent + " | " +
            values_text(parameter, [&](std::size_t k) { return parameter.lathe[k]; }) + " | " +
            std::string(kWriteNames[static_cast<std::size_t>(parameter.write)]) + " | " +
            hexadecimal(parameter.index) + " |\n";
  }
  return text;
}

}  // namespace cutforce::firmware::host
