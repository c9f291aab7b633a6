// The file as a whole: reading it, and in the end what nobody asked for.
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <fstream>
#include <regex>
#include <sstream>
#include <system_error>

#include "firmware/host/number_text.hpp"
#include "firmware/host/toml_contents.hpp"
#include "firmware/host/unit_hint.hpp"

namespace cutforce::firmware::host {
namespace {

constexpr std::size_t kLargestFile = std::size_t{1} << 20;

std::string in_section(const std::string& path) {
  return path.empty() ? "at the top of the file" : "in section [" + path + "]";
}

// The library's own words, less the part that every one of them begins with.
std::string syntax_what(std::string_view description) {
  constexpr std::string_view kPrefix = "Error while parsing ";
  if (!description.starts_with(kPrefix)) return std::string(description);
  return "cannot read the " + std::string(description.substr(kPrefix.size()));
}

// The mistakes of hands used to other formats, told by the line on which the library stopped.
std::string syntax_remedy(const std::string& line, std::string_view description) {
  const auto has = [&line](const char* pattern) {
    return line.size() < 500 && std::regex_search(line, std::regex(pattern));
  };
  if (description.find("redefine") != std::string_view::npos) return "keep one of the two";
  if (has("=\\s*[+-]?[0-9]+,[0-9]")) return "write the decimal mark as a point: 0.75";
  if (has("=\\s*[+-]?[0-9.]+([eE][+-]?[0-9]+)?\\s*[A-Za-z%]")) {
    return "write the number without a unit: the key names the unit";
  }
  if (has("=\\s*\\.[0-9]")) return "write a digit before the decimal point: 0.75";
  if (has("=\\s*[0-9]+\\.(\\s|$|[eE])")) return "write a digit after the decimal point: 5.0";
  if (has("=\\s*(True|TRUE|yes|on|False|FALSE|no|off)\\b")) return "write true or false";
  if (has("=\\s*[A-Za-z]")) return "put text in double quotes: winding = \"star\"";
  if (has("^\\s*[A-Za-z_0-9]+\\s*:")) return "write key = value, with an equals sign";
  if (has("^\\s*(;|//)")) return "begin a comment with #";
  return "write one key = value a line, sections as [name], text in double quotes";
}

std::string conversion_remedy(const UnitHint& hint, const toml::node& value) {
  const std::string key(hint.key);
  const std::optional<double> number = value.value<double>();
  if (!hint.factor || !number || !value.is_number() || !std::isfinite(*number)) {
    return "write " + key + ", in that unit";
  }
  return "write " + key + " = " + number_text(static_cast<float>(*number * *hint.factor));
}

}  // namespace

std::string printable(std::string_view text) {
  constexpr std::size_t kLongest = 60;
  std::string result;
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    result += code < 0x20 || code == 0x7f ? '?' : c;
    if (result.size() == kLongest) {
      result += "...";
      break;
    }
  }
  return result;
}

void TomlDocument::Contents::refuse_unknown(const toml::key& key, const toml::node& value,
                                            const std::string& path) {
  const std::string word(key.str());
  const toml::source_position position = key.source().begin;
  const std::string shown = printable(word);
  const std::string kind = value.is_table() || value.is_array_of_tables() ? "section" : "key";
  for (const auto& [other, keys] : asked) {
    if (other != path && keys.contains(word) && !value.is_table()) {
      refuse(position, shown + " does not belong " + in_section(path),
             other.empty() ? "move it to the top of the file, before the first section"
                           : "move it to section [" + other + "]");
      return;
    }
  }
  // The section's own names first; what is written at the top may be meant for any section.
  std::vector<std::string_view> candidates = names(path);
  const std::size_t own = candidates.size();
  for (const auto& [other, keys] : asked) {
    if (other != path) candidates.insert(candidates.end(), keys.begin(), keys.end());
  }
  const auto elsewhere = [this, &path](std::string_view meant) -> std::string {
    const auto here = asked.find(path);
    if (here != asked.end() && here->second.contains(meant)) return {};
    for (const auto& [other, keys] : asked) {
      if (keys.contains(meant)) return " " + in_section(other);
    }
    return {};
  };
  for (const auto reach : {own, candidates.size()}) {
    const std::span<const std::string_view> within{candidates.data(), reach};
    if (const auto hint = unit_hint(word, within); hint && !value.is_table()) {
      const std::string wrong =
          hint->unit.empty() ? " does not name its unit" : " is not in a unit that is used here";
      refuse(position, shown + wrong, conversion_remedy(*hint, value) + elsewhere(hint->key));
      return;
    }
    if (const auto meant = nearest(word, within)) {
      refuse(position, "unknown " + kind + " " + shown + " " + in_section(path),
             "did you mean " + std::string(*meant) + elsewhere(*meant) + "?");
      return;
    }
  }
  refuse(position, "unknown " + kind + " " + shown + " " + in_section(path),
         "remove it, or take a name from the list of parameters");
}

void TomlDocument::Contents::refuse_unvisited(const toml::table& parent, const std::string& path) {
  for (const auto& [key, value] : parent) {
    if (!visited.contains(&value)) {
      refuse_unknown(key, value, path);
      continue;
    }
    const std::string below =
        path.empty() ? std::string(key.str()) : path + "." + std::string(key.str());
    if (const toml::table* child = value.as_table()) refuse_unvisited(*child, below);
    if (const toml::array* array = value.as_array()) {
      for (const toml::node& element : *array) {
        if (const toml::table* child = element.as_table()) refuse_unvisited(*child, below);
      }
    }
  }
}

TomlDocument::TomlDocument() : contents_(std::make_unique<Contents>()) {}
TomlDocument::~TomlDocument() = default;

TomlSection TomlDocument::root() { return {*this, &contents_->table, ""}; }

std::expected<std::unique_ptr<TomlDocument>, InputError> TomlDocument::parse(std::string_view text,
                                                                             std::string name) {
  std::unique_ptr<TomlDocument> document(new TomlDocument);
  document->contents_->name = std::move(name);
  try {
    document->contents_->table = toml::parse(text);
  } catch (const toml::parse_error& error) {
    const toml::source_position position = error.source().begin;
    std::istringstream lines{std::string(text)};
    std::string line;
    for (std::uint32_t k = 0; k < position.line; ++k) std::getline(lines, line);
    return std::unexpected{InputError{document->contents_->where(position),
                                      syntax_what(error.description()),
                                      syntax_remedy(line, error.description())}};
  }
  return document;
}

std::expected<std::unique_ptr<TomlDocument>, InputError> TomlDocument::read(
    const std::filesystem::path& path) {
  const auto failure = [&path](const std::string& what) {
    return std::unexpected{
        InputError{path.string(), what, "name a TOML file that exists and can be read"}};
  };
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return failure("it is a folder, not a file");
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file) return failure("it cannot be opened: " + std::generic_category().message(errno));
  std::string text(kLargestFile + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (file.bad()) return failure("it cannot be read");
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.size() > kLargestFile)
    return failure("it is longer than 1 MiB, so it is no file of settings");
  return parse(text, path.string());
}

std::vector<InputError> TomlDocument::finish() {
  auto& errors = contents_->errors;
  contents_->refuse_unvisited(contents_->table, "");
  std::ranges::stable_sort(errors, [](const auto& a, const auto& b) {
    return a.line != b.line ? a.line < b.line : a.column < b.column;
  });
  std::vector<InputError> result;
  for (auto& located : errors) result.push_back(std::move(located.error));
  errors.clear();
  return result;
}

}  // namespace cutforce::firmware::host
