#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>

#include "firmware/host/commands/command.hpp"
#include "firmware/host/machine_file.hpp"
#include "firmware/host/machine_header.hpp"
#include "firmware/host/number_text.hpp"
#include "firmware/host/run/loop_recorder.hpp"
#include "firmware/host/write_file.hpp"

namespace cutforce::firmware::host {
namespace {

struct Options {
  std::string machine;
  std::string out;
  double rate_hz = 0.0;
};

MachineFile file_of(const Options& options) {
  if (!options.machine.empty()) return read_machine_file(options.machine);
  return parse_machine_text(machine_file_text(default_machine()), "the default lathe");
}

Exit perform(const Options& options) {
  MachineFile file = file_of(options);
  if (options.rate_hz > 0.0) {
    set_value(file, "sample_rate_hz", number_text(static_cast<float>(options.rate_hz)), "--rate");
  }
  const auto loaded = complete(std::move(file));
  if (!loaded) return refuse(loaded.error());
  const std::string origin =
      options.machine.empty()
          ? "The default lathe."
          : "From " + std::filesystem::path(options.machine).filename().string() + ".";
  // What the blocks refuse shows here, not on the board.
  if (const auto loop = make_loop(loaded->machine); !loop) {
    return refuse(loop_refused(loop.error(),
                               options.machine.empty() ? "the default lathe" : options.machine));
  }
  show_warnings(loaded->warnings);
  const std::string text = machine_header_text(loaded->machine, origin);
  if (options.out.empty()) {
    std::cout << text;
    return Exit::kDone;
  }
  const auto written = write_file(options.out, text);
  if (!written) show_error(written.error());
  return written ? Exit::kDone : Exit::kFailed;
}

}  // namespace

void add_embed(CLI::App& program, Action& action) {
  auto* command = program.add_subcommand(
      "embed", "A machine file as a C++ header, for the image of a bare-metal board");
  auto options = std::make_shared<Options>();
  command->add_option("MACHINE", options->machine, "Machine file; left out: the default lathe");
  command->add_option("--out", options->out, "Header to write; left out: standard output")
      ->type_name("FILE");
  command
      ->add_option("--rate", options->rate_hz,
                   "Samples a second, where the machine file does not say it")
      ->type_name("HZ")
      ->check(CLI::PositiveNumber);
  command->footer(R"(Examples:
  cutforce embed machine.toml --out machine_config.hpp
  cmake --preset cortex-m -D CUTFORCE_MACHINE_HEADER=$PWD/machine_config.hpp

The machine is checked here, and by the compiler again; every value keeps its bits.)");
  command->callback([options, &action] { action = [options] { return perform(*options); }; });
}

}  // namespace cutforce::firmware::host
