#include <algorithm>
#include <csignal>
#include <exception>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "firmware/host/commands/command.hpp"
#include "firmware/host/commands/progress.hpp"
#include "firmware/host/unit_hint.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::InputError;

constexpr const char* kFooter =
    R"(Examples:
  cutforce demo
  cutforce replay host_tests/recordings/entry_cut.csv.gz --out trace.csv
  cutforce check --template > machine.toml
  cutforce COMMAND --help

Exit status: 0 done; 1 the work failed or a check did not hold; 2 the input or the command line is
wrong.)";

// A first word that is no command, and the command that was probably meant.
std::optional<InputError> unknown_command(const CLI::App& program, const std::string& word) {
  std::vector<std::string_view> names;
  std::vector<std::string> kept;
  for (const auto* command : program.get_subcommands({})) kept.push_back(command->get_name());
  for (const auto& name : kept) names.push_back(name);
  if (word.starts_with('-') || std::ranges::find(names, word) != names.end()) return {};
  const auto meant = nearest(word, names);
  return InputError{"cutforce", "there is no command " + word,
                    meant ? "perhaps " + std::string(*meant) + " is meant; see cutforce --help"
                          : "see cutforce --help"};
}

// CLI11 has an exit status for each mistake; a person has one.
int understand(const CLI::App& program, const CLI::ParseError& error, const char* first) {
  if (error.get_exit_code() == 0) return program.exit(error);
  if (first != nullptr) {
    if (const auto unknown = unknown_command(program, first)) {
      return static_cast<int>(refuse(*unknown));
    }
  }
  std::cerr << "cutforce: " << error.what() << "\n";
  const auto chosen = program.get_subcommands();
  std::cerr << "  remedy: see cutforce " << (chosen.empty() ? "" : chosen[0]->get_name() + " ")
            << "--help\n";
  return static_cast<int>(Exit::kBadInput);
}

int perform(const Action& action) {
  const Exit exit = action();
  std::cout.flush();
  if (!std::cout) {
    std::cerr << "cutforce: standard output cannot be written\n";
    return static_cast<int>(Exit::kFailed);
  }
  return static_cast<int>(exit);
}

}  // namespace

void show_error(const hal::host::InputError& error) { std::cerr << error.text() << "\n"; }

void show_errors(std::span<const hal::host::InputError> errors) {
  for (const auto& error : errors) show_error(error);
}

void show_warnings(std::span<const std::string> warnings) {
  for (const auto& warning : warnings) std::cerr << "warning: " << warning << "\n";
}

Exit refuse(const hal::host::InputError& error) {
  show_error(error);
  return Exit::kBadInput;
}

Exit refuse(std::span<const hal::host::InputError> errors) {
  show_errors(errors);
  return Exit::kBadInput;
}

int run_program(int argc, const char* const* argv, const BenchPorts& ports) {
  CLI::App program{
      "Cutting force from the spindle motor's voltages and currents, held by the feed "
      "override.",
      "cutforce"};
  program.footer(kFooter);
  program.require_subcommand(1);
  program.set_version_flag("--version", CUTFORCE_VERSION);
  Action action;
  for (const auto add :
       {add_demo, add_simulate, add_replay, add_evaluate, add_check, add_report, add_lockstep,
        add_reproduce, add_compare, add_tune, add_convert, add_hash, add_embed}) {
    add(program, action);
  }
  add_cnc(program, action, ports);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return understand(program, error, argc > 1 ? argv[1] : nullptr);
  }
  std::signal(SIGPIPE, SIG_IGN);  // a reader that went away is a failed write, not the end
  try {
    return perform(action);
  } catch (const Stopped& stopped) {
    std::cerr << "cutforce: stopped; nothing was left behind\n";
    return 128 + stopped.signal;
  } catch (const std::exception& error) {
    std::cerr << "cutforce: " << error.what() << "\n";
    return static_cast<int>(Exit::kFailed);
  }
}

}  // namespace cutforce::firmware::host
