#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware/host/commands/command.hpp"
#include "firmware/host/commands/progress.hpp"
#include "firmware/host/reproduce/reproduction.hpp"
#include "firmware/host/run/output_folder.hpp"
#include "firmware/host/write_file.hpp"

namespace cutforce::firmware::host {
namespace {

struct Options {
  std::string out = "out/reproduce";
  std::string figure;
  bool json = false;
};

Exit perform(const Options& options) {
  catch_stop_signals();
  const auto reproduction = reproduce(options.figure);
  if (!reproduction) return refuse(reproduction.error());
  auto folder = OutputFolder::make(options.out);
  if (!folder) return refuse(folder.error());
  const auto page = std::filesystem::path(options.out) / "reproduction.html";
  if (const auto written = write_file(page, reproduction_page(*reproduction)); !written) {
    show_error(written.error());
    return Exit::kFailed;
  }
  folder->keep();
  if (options.json) {
    auto json = reproduction_json(*reproduction);
    json["page"] = page.string();
    std::cout << json.dump(2) << "\n";
  } else {
    std::cout << reproduction_text(*reproduction) << "\npage: " << page.string() << "\n";
  }
  return reproduction->holds() ? Exit::kDone : Exit::kFailed;
}

}  // namespace

void add_reproduce(CLI::App& program, Action& action) {
  auto* command = program.add_subcommand(
      "reproduce", "The three papers' figures: what they say, what comes out, and why");
  auto options = std::make_shared<Options>();
  command->add_option("--out", options->out, "Folder for the page")
      ->type_name("DIR")
      ->capture_default_str();
  command->add_option("--figure", options->figure, "One figure alone, p1_fig08 to p3_fig08")
      ->type_name("NAME");
  command->add_flag("--json", options->json, "Print the findings as JSON");
  command->footer(R"(Examples:
  cutforce reproduce
  cutforce reproduce --figure p1_fig10 --out out/fig10
  cutforce simulate host_tests/scenarios/papers/p1_fig10.toml

Exit status 1 where a number that must come out does not.)");
  command->callback([options, &action] { action = [options] { return perform(*options); }; });
}

}  // namespace cutforce::firmware::host
