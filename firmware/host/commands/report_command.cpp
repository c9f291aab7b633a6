#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <string>

#include "firmware/host/commands/command.hpp"
#include "firmware/host/report/report.hpp"

namespace cutforce::firmware::host {

void add_report(CLI::App& program, Action& action) {
  auto* command = program.add_subcommand("report", "One page with plots from the files of a run");
  auto folder = std::make_shared<std::string>();
  command->add_option("DIR", *folder, "Folder that a run has written, or that holds trace.csv")
      ->required();
  command->footer(R"(Examples:
  cutforce report out/demo

The page report.html is written into the folder; it opens without a network.)");
  command->callback([folder, &action] {
    action = [folder] {
      const auto page = write_report(*folder);
      if (!page) return refuse(page.error());
      std::cout << page->string() << "\n";
      return Exit::kDone;
    };
  });
}

}  // namespace cutforce::firmware::host
