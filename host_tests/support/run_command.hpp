// Runs a command line in a shell, as a person would, and returns what it printed.
#pragma once

#include <string>

namespace cutforce::host_tests {

struct CommandResult {
  int exit_status;     // 127: no such command; 128 + n: ended by signal n
  std::string output;  // standard output; add 2>&1 to the command for both
};

[[nodiscard]] CommandResult run_command(const std::string& command);

// In single quotes, for a path in a command line.
[[nodiscard]] std::string quoted(const std::string& text);

}  // namespace cutforce::host_tests
