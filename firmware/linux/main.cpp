#include <CLI/CLI.hpp>
#include <string>

#include "firmware/linux/service.hpp"

int main(int argc, char** argv) {
  CLI::App program("Keeps the cutting force constant: the service of an ARM64 board.", "cutforced");
  program.set_version_flag("--version", CUTFORCE_VERSION);
  std::string board = "/etc/cutforce/board.toml";
  cutforce::firmware::board::ServiceOptions options{};
  program.add_option("board", board, "How the board is wired; it names the machine file")
      ->capture_default_str();
  program.add_flag("--check", options.check_only, "Check both files, open nothing");
  program.add_option("--ticks", options.ticks, "End after so many ticks (for tests)");
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;
  }
  options.board = board;
  return cutforce::firmware::board::run_service(options);
}
