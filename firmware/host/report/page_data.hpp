// Numbers as a page carries them: little-endian, in base 64.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace cutforce::firmware::host {

[[nodiscard]] std::string base64(const std::vector<float>& values);
[[nodiscard]] std::string base64(const std::vector<double>& values);

// Times. An even grid is three numbers; any other is embedded.
[[nodiscard]] nlohmann::ordered_json grid(const std::vector<double>& time_s);

}  // namespace cutforce::firmware::host
