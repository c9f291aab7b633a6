// The cutforce program as a person runs it.
#pragma once

#include <filesystem>
#include <string>

#include "support/run_command.hpp"

namespace cutforce::host_tests {

// Standard output and error together; the arguments are shell text.
[[nodiscard]] inline CommandResult cutforce(const std::string& arguments) {
  return run_command(quoted(CUTFORCE_PROGRAM) + " " + arguments + " 2>&1");
}
// Standard output alone.
[[nodiscard]] inline CommandResult cutforce_output(const std::string& arguments) {
  return run_command(quoted(CUTFORCE_PROGRAM) + " " + arguments + " 2>/dev/null");
}

[[nodiscard]] inline std::filesystem::path in_tests(const std::string& path) {
  return std::filesystem::path(CUTFORCE_SOURCE_DIR) / "host_tests" / path;
}
[[nodiscard]] inline std::string committed(const std::string& recording) {
  return quoted(in_tests("recordings/" + recording + ".csv.gz").string());
}

[[nodiscard]] inline std::string q(const std::filesystem::path& path) {
  return quoted(path.string());
}

}  // namespace cutforce::host_tests
