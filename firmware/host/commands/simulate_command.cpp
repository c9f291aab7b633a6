#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "firmware/host/commands/command.hpp"
#include "firmware/host/commands/machine_options.hpp"
#include "firmware/host/commands/progress.hpp"
#include "firmware/host/run/simulate.hpp"

namespace cutforce::firmware::host {
namespace {

// P3's own, beside which the run's estimator is shown.
constexpr EstimatorName kPublished[] = {EstimatorName::kComputed, EstimatorName::kSynthesized,
                                        EstimatorName::kMeasured};

struct Options {
  std::string scenario;
  std::string out;
  std::string recording;
  BlockOptions blocks;
  bool compare = false;
  std::string template_model;
  bool scenario_text = false;
  bool json = false;
};

Exit show(const SimulationResult& result, const Options& options) {
  if (options.json) {
    auto json = summary_json(result.summary);
    json["report"] = result.report.string();
    std::cout << json.dump(2) << "\n";
  } else {
    show_warnings(result.summary.warnings);
    std::cout << result.summary.title << "\n\n" << figure_text(result.summary.figures);
    if (!result.summary.verdict.empty()) std::cout << "\n" << result.summary.verdict << "\n";
    std::cout << "\nreport: " << result.report.string() << "\n";
  }
  return result.refused ? Exit::kFailed : Exit::kDone;
}

Exit run_scenario(const Scenario& scenario, const Options& options) {
  catch_stop_signals();
  if (!options.recording.empty()) {
    const auto made = simulate_recording(scenario, options.recording);
    return made ? Exit::kDone : refuse(made.error());
  }
  const std::span<const EstimatorName> none;
  const auto result =
      simulate(scenario, options.out, options.compare ? std::span(kPublished) : none);
  return result ? show(*result, options) : refuse(result.error());
}

Exit show_template(const std::string& model) {
  if (model != "motor" && model != "force") {
    return refuse(InputError{"--template", "there is no model " + model,
                             "give --template for a machine with its motor, --template=force for "
                             "one without"});
  }
  std::cout << (model == "force" ? force_scenario_template() : scenario_template(Preset::kLathe));
  return Exit::kDone;
}

Exit perform_simulate(Options options) {
  if (!options.template_model.empty()) return show_template(options.template_model);
  if (options.scenario.empty()) {
    return refuse(
        InputError{"SCENARIO", "no scenario is named", "name a file, or ask for --template"});
  }
  const auto scenario = read_scenario(options.scenario, options.blocks.options());
  if (!scenario) return refuse(scenario.error());
  if (options.compare && scenario->model == Model::kForce) {
    return refuse(InputError{"--compare",
                             "a machine without its motor has no signals to compare "
                             "estimators on",
                             "leave it out, or simulate a scenario with model = \"motor\""});
  }
  if (options.out.empty()) {
    options.out = "out/" + std::filesystem::path(options.scenario).stem().string();
  }
  return run_scenario(*scenario, options);
}

Exit perform_demo(Options options) {
  if (options.scenario_text) {
    std::cout << demo_scenario_text();
    return Exit::kDone;
  }
  const auto scenario = parse_scenario(demo_scenario_text(), "demo", options.blocks.options());
  if (!scenario) return refuse(scenario.error());
  options.compare = true;
  return run_scenario(*scenario, options);
}

}  // namespace

void add_demo(CLI::App& program, Action& action) {
  auto* command = program.add_subcommand(
      "demo", "The main job with nothing to prepare: a simulated lathe in closed loop");
  auto options = std::make_shared<Options>();
  options->out = "out/demo";
  command->add_option("--out", options->out, "Folder for the files of the run")
      ->type_name("DIR")
      ->capture_default_str();
  options->blocks.add_to(*command, "the scenario");
  command->add_flag("--json", options->json, "Print the summary as JSON");
  command->add_flag("--scenario", options->scenario_text, "Print the demo's scenario instead");
  command->footer(
      R"(A 5.5 kW lathe turns; the tool enters at 1 mm depth of cut, and the depth steps to 1.5 mm. The loop
estimates the cutting force from voltages, currents and speed, and holds it by the feed override.

Examples:
  cutforce demo
  cutforce demo --scenario > mine.toml; cutforce simulate mine.toml)");
  command->callback([options, &action] { action = [options] { return perform_demo(*options); }; });
}

void add_simulate(CLI::App& program, Action& action) {
  auto* command =
      program.add_subcommand("simulate", "A scenario in closed loop: recording, trace, report");
  auto options = std::make_shared<Options>();
  command->add_option("SCENARIO", options->scenario, "Scenario file (TOML)");
  command->add_option("--out", options->out, "Folder for the files; left out: out/SCENARIO")
      ->type_name("DIR");
  command
      ->add_option("--recording", options->recording,
                   "Write only the recording, to this file (.csv, .csv.gz, .cfr)")
      ->type_name("FILE");
  options->blocks.add_to(*command, "the scenario");
  command->add_flag("--compare", options->compare, "Also P3's estimators, on the same samples");
  command->add_flag("--template{motor}", options->template_model,
                    "Print a commented scenario with every key instead; --template=force: of a "
                    "machine without its motor");
  command->add_flag("--json", options->json, "Print the summary as JSON");
  command->footer(R"(Examples:
  cutforce simulate --template > mine.toml
  cutforce simulate mine.toml --out out/mine --compare
  cutforce simulate mine.toml --controller fuzzy --out out/fuzzy
  cutforce simulate --template=force > quick.toml
  cutforce simulate host_tests/scenarios/vhz.toml --recording vhz.csv.gz

The same scenario gives the same files, bit for bit.)");
  command->callback(
      [options, &action] { action = [options] { return perform_simulate(*options); }; });
}

}  // namespace cutforce::firmware::host
