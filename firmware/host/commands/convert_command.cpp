#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "firmware/host/commands/command.hpp"
#include "hal/host/recording_writer.hpp"

namespace cutforce::firmware::host {

void add_convert(CLI::App& program, Action& action) {
  struct Options {
    std::string from;
    std::string to;
  };
  auto* command = program.add_subcommand("convert", "A recording in another form");
  auto options = std::make_shared<Options>();
  command->add_option("FROM", options->from, "Recording, in any form")->required();
  command->add_option("TO", options->to, "Form by its name: .csv, .csv.gz, .cfr (binary), .cfr.gz")
      ->required();
  command->footer(R"(Examples:
  cutforce convert cut.csv.gz cut.cfr
  cutforce convert cut.cfr cut.csv

The binary form reads five times as fast. Columns that are not of the recording's format are left
behind.)");
  command->callback([options, &action] {
    action = [options] {
      const auto converted = hal::host::convert_recording(options->from, options->to);
      return converted ? Exit::kDone : refuse(converted.error());
    };
  });
}

}  // namespace cutforce::firmware::host
