#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware/host/commands/command.hpp"
#include "firmware/host/machine_file.hpp"
#include "firmware/host/run/loop_recorder.hpp"
#include "firmware/host/scenario/scenario.hpp"

namespace cutforce::firmware::host {
namespace {

struct Options {
  std::string file;
  bool make_template = false;
  bool json = false;
};

struct Checked {
  std::string kind;
  std::vector<std::string> warnings;
  std::vector<InputError> errors;
};

Checked check_scenario(const std::string& path) {
  auto scenario = read_scenario(path);
  if (!scenario) return {"scenario", {}, std::move(scenario.error())};
  const auto loop = make_loop(scenario->machine);
  if (!loop) return {"scenario", {}, {loop_refused(loop.error(), path)}};
  return {"scenario", std::move(scenario->warnings), {}};
}

Checked check_machine(const std::string& path) {
  MachineFile file = read_machine_file(path);
  const bool own_rate = file.is_given("sample_rate_hz");
  auto loaded = complete(std::move(file));
  if (!loaded) return {"machine", {}, std::move(loaded.error())};
  Machine machine = loaded->machine;
  // A recording brings its rate; any that the periods are multiples of will do for the check.
  if (!own_rate) machine.sample_rate_hz = 5.0F / machine.estimate_period_s;
  const auto loop = make_loop(machine);
  if (!loop) return {"machine", {}, {loop_refused(loop.error(), path)}};
  return {"machine", std::move(loaded->warnings), {}};
}

Exit perform(const Options& options) {
  if (options.make_template) {
    std::cout << machine_file_text(default_machine());
    return Exit::kDone;
  }
  if (options.file.empty()) {
    return refuse(InputError{"FILE", "no file is named",
                             "name a machine file or a scenario, or ask for --template"});
  }
  const Checked checked =
      is_scenario(options.file) ? check_scenario(options.file) : check_machine(options.file);
  const bool sound = checked.errors.empty();
  if (options.json) {
    nlohmann::ordered_json json{{"file", options.file},
                                {"kind", checked.kind},
                                {"ok", sound},
                                {"derived", checked.warnings}};
    json["errors"] = nlohmann::ordered_json::array();
    for (const auto& error : checked.errors) {
      json["errors"].push_back(
          {{"where", error.where}, {"what", error.what}, {"remedy", error.remedy}});
    }
    std::cout << json.dump(2) << "\n";
    return sound ? Exit::kDone : Exit::kBadInput;
  }
  if (!sound) return refuse(checked.errors);
  std::cout << options.file << ": ok, a " << checked.kind
            << (checked.kind == "machine" ? " file" : "") << "\n";
  for (const auto& warning : checked.warnings) std::cout << "  " << warning << "\n";
  return Exit::kDone;
}

}  // namespace

void add_check(CLI::App& program, Action& action) {
  auto* command = program.add_subcommand("check", "Checks a machine file or a scenario");
  auto options = std::make_shared<Options>();
  command->add_option("FILE", options->file, "Which of the two it is, its keys tell");
  command->add_flag("--template", options->make_template,
                    "Write the commented machine file of the default lathe instead");
  command->add_flag("--json", options->json, "Print the result as JSON");
  command->footer(R"(Examples:
  cutforce check --template > machine.toml
  cutforce check machine.toml
  cutforce check host_tests/scenarios/ramp.toml

Every mistake is named with line, column and remedy (exit status 2). A sound file's output says what
was derived from the rating because it is not given. A template of a scenario: cutforce simulate
--template.)");
  command->callback([options, &action] { action = [options] { return perform(*options); }; });
}

}  // namespace cutforce::firmware::host
