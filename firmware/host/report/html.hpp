// Text into HTML, and the tables of a report.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cutforce::firmware::host {

// & < > " ' as entities: safe as text and in quoted attributes.
[[nodiscard]] std::string escaped(std::string_view text);

// JSON that cannot end the script element it stands in.
[[nodiscard]] std::string script_safe(std::string_view json);

// Replaces {{name}} by its text, which is not looked through again.
[[nodiscard]] std::string fill(std::string_view page,
                               const std::vector<std::pair<std::string_view, std::string>>& places);

// The text, or the list, under a key; empty if there is none.
[[nodiscard]] std::string text_in(const nlohmann::ordered_json& object, const char* key);
[[nodiscard]] const nlohmann::ordered_json& list_in(const nlohmann::ordered_json& object,
                                                    const char* key);

// Sections of the page; empty text where the summary has nothing for them.
[[nodiscard]] std::string figure_table(const nlohmann::ordered_json& summary);
[[nodiscard]] std::string event_table(const nlohmann::ordered_json& summary);
[[nodiscard]] std::string machine_table(const nlohmann::ordered_json& summary);

}  // namespace cutforce::firmware::host
