// What the two halves of toml_check.hpp share; nobody else includes it, for the library is large.
#pragma once

#include <toml++/toml.h>

#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "firmware/host/toml_check.hpp"

namespace cutforce::firmware::host {

// What was in the file may hold anything; what is shown to a person is one line of plain text.
[[nodiscard]] std::string printable(std::string_view text);

struct TomlDocument::Contents {
  struct Located {
    std::uint32_t line;
    std::uint32_t column;
    InputError error;
  };

  std::string name;
  toml::table table;
  std::vector<Located> errors;
  std::set<const toml::node*> visited;
  // What was asked for, by path of the section: the names from which a remedy is chosen.
  std::map<std::string, std::set<std::string, std::less<>>, std::less<>> asked;

  [[nodiscard]] std::string where(const toml::source_position& position) const {
    if (position.line == 0) return name;
    return name + ":" + std::to_string(position.line) + ":" + std::to_string(position.column);
  }
  void refuse(const toml::source_position& position, std::string what, std::string remedy) {
    const auto end = std::numeric_limits<std::uint32_t>::max();
    errors.push_back({position.line == 0 ? end : position.line,
                      position.column,
                      {where(position), std::move(what), std::move(remedy)}});
  }
  [[nodiscard]] std::vector<std::string_view> names(const std::string& path) const {
    const auto found = asked.find(path);
    if (found == asked.end()) return {};
    return {found->second.begin(), found->second.end()};
  }
  void refuse_unvisited(const toml::table& parent, const std::string& path);
  void refuse_unknown(const toml::key& key, const toml::node& value, const std::string& path);
};

}  // namespace cutforce::firmware::host
