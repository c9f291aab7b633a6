#include "firmware/host/machine_file.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "firmware/host/number_text.hpp"
#include "firmware/host/toml_check.hpp"
#include "firmware/host/unit_hint.hpp"

namespace cutforce::firmware::host {
namespace {

NumberRule rule_of(const Parameter& parameter) {
  return {.minimum = parameter.minimum,
          .maximum = parameter.maximum,
          .unit = parameter.unit,
          .zero_means = parameter.zero_means,
          .whole = parameter.kind == Kind::kWhole};
}

// The values of one parameter from the file; empty where it is absent or refused.
std::vector<float> values_from(TomlSection& section, const Parameter& parameter) {
  const auto one = [](const auto& value) {
    return value ? std::vector<float>{static_cast<float>(*value)} : std::vector<float>{};
  };
  switch (parameter.kind) {
    case Kind::kNumber:
    case Kind::kWhole:
      return one(section.number(parameter.key, rule_of(parameter)));
    case Kind::kTriple:
      return section.numbers(parameter.key, parameter.size(), rule_of(parameter))
          .value_or(std::vector<float>{});
    case Kind::kFlag:
      return one(section.flag(parameter.key));
    case Kind::kChoice:
      return one(section.choice(parameter.key, parameter.names));
  }
  return {};
}

void give(MachineFile& file, std::size_t index, std::span<const float> values, std::string where) {
  const Parameter& parameter = kParameters[index];
  for (std::size_t k = 0; k < parameter.size(); ++k) {
    parameter.set(file.machine, k, values.size() == 1 ? values[0] : values[k]);
  }
  file.where[index] = parameter.says_nothing(file.machine) ? std::string() : std::move(where);
  file.refused[index] = false;
  if (parameter.key == "iron_loss_w" && !file.is_given("iron_loss_declared")) {
    file.machine.iron_loss_declared = true;
  }
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kSpace = " \t\r\n";
  const auto first = text.find_first_not_of(kSpace);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kSpace) - first + 1);
}

std::string one_line(std::string_view text) {
  std::string result(text.substr(0, 60));
  std::ranges::replace_if(
      result, [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return result;
}

// What is wrong with a value given as text, and the remedy; or the numbers it stands for.
using TextValue = std::expected<std::vector<float>, std::pair<std::string, std::string>>;

TextValue numbers_from_text(const Parameter& parameter, std::string_view text) {
  const std::string remedy = "give " + range_text(rule_of(parameter));
  const auto refuse = [&](const std::string& what) {
    return std::unexpected{std::pair{std::string(parameter.key) + what, remedy}};
  };
  if (text.starts_with('[') && text.ends_with(']')) text = text.substr(1, text.size() - 2);
  std::vector<float> values;
  while (!(text = trimmed(text)).empty()) {
    if (text.starts_with('+')) text.remove_prefix(1);
    float value = 0.0F;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const auto rest = text.substr(static_cast<std::size_t>(end - text.data()));
    const bool more = parameter.size() > 1 && !rest.empty() &&
                      (rest[0] == ',' || rest[0] == ' ' || rest[0] == '\t');
    const bool ends_well = rest.empty() || more;
    if (error == std::errc::invalid_argument || !ends_well) {
      return refuse(": \"" + one_line(text) + "\" is not a number");
    }
    if (error != std::errc{} || !parameter.allows(value)) {
      auto hint = scale_hint(static_cast<double>(value), parameter.unit,
                             static_cast<double>(parameter.minimum),
                             static_cast<double>(parameter.maximum));
      auto refusal = refuse(" = " + one_line(text) + " is out of range");
      if (hint) {
        refusal.error().second += "; if it is in " + std::string(hint->unit) + ", write " +
                                  number_text(static_cast<float>(hint->value));
      }
      return refusal;
    }
    values.push_back(value);
    text = trimmed(rest);
    if (text.starts_with(',')) text.remove_prefix(1);
  }
  if (values.size() != 1 && values.size() != parameter.size()) {
    return refuse(" has " + std::to_string(values.size()) + " values, not " +
                  std::to_string(parameter.size()));
  }
  return values;
}

TextValue values_from_text(const Parameter& parameter, std::string_view text) {
  text = trimmed(text);
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') {
    text = text.substr(1, text.size() - 2);
  }
  static constexpr std::array<std::string_view, 2> kFlags{"false", "true"};
  std::span<const std::string_view> names = parameter.names;
  if (parameter.kind == Kind::kFlag) names = kFlags;
  if (names.empty()) return numbers_from_text(parameter, text);
  if (parameter.kind == Kind::kFlag && (text == "0" || text == "1")) {
    return std::vector<float>{text == "1" ? 1.0F : 0.0F};
  }
  const auto found = std::ranges::find(names, text);
  if (found != names.end()) return std::vector<float>{static_cast<float>(found - names.begin())};
  std::string known;
  for (const std::string_view name : names)
    known += (known.empty() ? "" : ", ") + std::string(name);
  return std::unexpected{
      std::pair{std::string(parameter.key) + " cannot be \"" + one_line(text) + "\"",
                "give one of " + known}};
}

void fill(MachineFile& file, TomlDocument& document) {
  fill_sections(file, document.root(), [](Section) { return true; });
  file.errors = document.finish();
}

}  // namespace

void fill_sections(MachineFile& file, TomlSection root, bool (*wanted)(Section)) {
  std::optional<Section> open;
  std::optional<TomlSection> section;
  for (std::size_t k = 0; k < kParameters.size(); ++k) {
    const Parameter& parameter = kParameters[k];
    if (!wanted(parameter.section)) continue;
    if (open != parameter.section) section = root.section(name_of(parameter.section));
    open = parameter.section;
    if (!section->has(parameter.key)) continue;
    const std::vector<float> values = values_from(*section, parameter);
    if (values.empty()) {
      file.refused[k] = true;
    } else {
      give(file, k, values, section->where(parameter.key));
    }
  }
}

bool MachineFile::is_given(std::string_view key) const {
  const auto index = find_parameter(key);
  return index && !where[*index].empty();
}

MachineFile parse_machine_text(std::string_view text, std::string name) {
  MachineFile file;
  file.name = name;
  auto document = TomlDocument::parse(text, std::move(name));
  if (document) {
    fill(file, **document);
  } else {
    file.unreadable = true;
    file.errors.push_back(document.error());
  }
  return file;
}

MachineFile read_machine_file(const std::filesystem::path& path) {
  MachineFile file;
  file.name = path.string();
  auto document = TomlDocument::read(path);
  if (document) {
    fill(file, **document);
  } else {
    file.unreadable = true;
    file.errors.push_back(document.error());
  }
  return file;
}

void merge_metadata(MachineFile& file, std::span<const RecordedValue> values,
                    std::string_view recording) {
  const MachineFile before = file;
  for (const RecordedValue& entry : values) {
    const auto index = find_parameter(entry.key);
    if (!index || kParameters[*index].section > Section::kPowerMeter) continue;
    const bool in_file = before.is_given(entry.key) || before.refused[*index];
    const bool file_denies_it = entry.key == "iron_loss_w" &&
                                before.is_given("iron_loss_declared") &&
                                !before.machine.iron_loss_declared;
    std::string where(recording);
    if (entry.line != 0) where += ":" + std::to_string(entry.line) + ":1";
    const TextValue numbers = values_from_text(kParameters[*index], entry.value);
    if (!numbers) {
      file.refused[*index] = file.refused[*index] || !in_file;
      file.errors.push_back({where, numbers.error().first, numbers.error().second});
    } else if (!in_file && !file_denies_it) {
      const Machine first = file.machine;
      const bool doubled = file.is_given(entry.key);
      give(file, *index, *numbers, where);
      if (doubled && !(first == file.machine)) {
        file.errors.push_back({where, std::string(entry.key) + " is given twice, with two values",
                               "keep one of the two lines"});
      }
    }
  }
}

bool set_value(MachineFile& file, std::string_view key, std::string_view value, std::string where) {
  const auto index = find_parameter(key);
  if (!index) {
    file.errors.push_back({std::move(where), "unknown key " + one_line(key),
                           "take a name from the list of parameters"});
    return false;
  }
  const TextValue numbers = values_from_text(kParameters[*index], value);
  if (!numbers) {
    file.refused[*index] = true;
    file.errors.push_back({std::move(where), numbers.error().first, numbers.error().second});
    return false;
  }
  give(file, *index, *numbers, std::move(where));
  return true;
}

}  // namespace cutforce::firmware::host
