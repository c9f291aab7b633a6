#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "firmware/host/commands/command.hpp"
#include "firmware/host/commands/machine_options.hpp"
#include "firmware/host/commands/progress.hpp"
#include "firmware/host/evaluation/evaluate.hpp"
#include "firmware/host/run/loop_recorder.hpp"
#include "firmware/host/run/recorded_machine.hpp"
#include "firmware/host/write_file.hpp"
#include "hal/host/truth_reader.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::TruthReader;

struct Options {
  std::string folder = "host_tests/recordings";
  std::string json_file;
  std::vector<std::string> estimators;
  std::vector<std::string> conditions;
  bool quick = false;
  bool json = false;
  bool check = false;
};

constexpr std::size_t kBlockRows = 4096;
constexpr float kRateHz = 1000.0F;

bool speaks_of_pwm(const std::vector<hal::host::Metadata>& metadata) {
  return std::ranges::any_of(metadata, [](const hal::host::Metadata& entry) {
    return entry.key == "voltage" && entry.value.find("PWM") != std::string::npos;
  });
}

// The cutting torque; where the recording knows only a force, nothing to compare with.
std::expected<EvaluationRecording, InputError> open_recording(const std::filesystem::path& path) {
  auto reader = TruthReader::open(path);
  if (!reader) return std::unexpected{reader.error()};
  const auto period = reader->sample_period();
  if (!period) return std::unexpected{period.error()};
  auto loaded = recorded_machine(reader->info(), *period, {});
  if (!loaded) return std::unexpected{loaded.error().front()};
  std::string name = path.filename().string();
  for (const std::string_view end : {".gz", ".csv", ".cfr"}) {
    if (name.ends_with(end)) name.resize(name.size() - end.size());
  }
  EvaluationRecording recording{.name = std::move(name),
                                .samples = {},
                                .machine = loaded->machine,
                                .truth = {},
                                .pwm = speaks_of_pwm(reader->info().metadata)};
  recording.truth.rated_torque_nm = static_cast<double>(loaded->machine.rated_torque_nm);
  std::vector<hal::Sample> samples(kBlockRows);
  std::vector<hal::host::Truth> truths(kBlockRows);
  for (;;) {
    const auto count = reader->read(samples, truths);
    if (!count) return std::unexpected{count.error()};
    if (*count == 0) return recording;
    for (std::size_t k = 0; k < *count; ++k) {
      recording.samples.push_back(samples[k]);
      if (!truths[k].has(hal::host::TruthSignal::kCuttingTorque)) continue;
      recording.truth.time_s.push_back(static_cast<double>(samples[k].time_ns) * 1e-9);
      recording.truth.torque_nm.push_back(static_cast<double>(truths[k].cutting_torque_nm));
    }
  }
}

// At 1 kHz, or each sample where they are slower. What comes only with a control tick is handed on
// only then.
std::expected<std::vector<LoopOutput>, std::string> run_estimator(
    std::span<const hal::Sample> samples, const Machine& machine, EstimatorName estimator) {
  Machine own = machine;
  own.estimator = estimator;
  if (own.sample_rate_hz >= kRateHz) {
    const float every = std::round(own.sample_rate_hz / kRateHz);
    own.estimate_period_s = every / own.sample_rate_hz;
    own.control_period_s =
        std::round(own.control_period_s / own.estimate_period_s) * own.estimate_period_s;
  }
  auto loop = loop_for(own, "the machine");
  if (!loop) return std::unexpected{loop.error().what};
  const bool fast = estimator == EstimatorName::kFused;
  std::vector<LoopOutput> outputs;
  for (const hal::Sample& sample : samples) {
    const auto output = loop->step(sample);
    if (output && (fast || output->control_tick)) outputs.push_back(*output);
  }
  return outputs;
}

std::expected<EvaluationOptions, InputError> choose(const Options& options) {
  EvaluationOptions chosen;
  if (!options.estimators.empty()) chosen.estimators.clear();
  for (const auto& name : options.estimators) {
    const auto found = std::ranges::find(kNames<EstimatorName>, name);
    if (found == kNames<EstimatorName>.end()) {
      return std::unexpected{InputError{"--estimator", "there is none named " + name,
                                        "give one of " + names_text<EstimatorName>()}};
    }
    chosen.estimators.push_back(static_cast<EstimatorName>(found - kNames<EstimatorName>.begin()));
  }
  for (const auto& name : options.conditions) {
    if (const Condition* condition = find_condition(name)) {
      chosen.conditions.push_back(*condition);
      continue;
    }
    std::string known;
    for (const auto& c : all_conditions()) {
      known += (known.empty() ? "" : ", ") + std::string(c.name);
    }
    return std::unexpected{
        InputError{"--condition", "there is none named " + name, "give one of " + known}};
  }
  if (options.quick && chosen.conditions.empty()) {
    chosen.conditions.push_back(all_conditions().front());
  }
  return chosen;
}

Exit perform(const Options& options) {
  catch_stop_signals();
  const auto chosen = choose(options);
  if (!chosen) return refuse(chosen.error());
  const auto recordings = find_recordings(options.folder);
  if (recordings.empty()) {
    return refuse(InputError{options.folder, "there are no recordings below this folder",
                             "name a folder that holds .csv or .csv.gz files"});
  }
  Evaluation evaluation;
  {
    Progress progress("evaluate", "runs");
    evaluation = evaluate(recordings, *chosen, open_recording, run_estimator,
                          [&](std::size_t done, std::size_t total, std::string_view what) {
                            progress.show(static_cast<double>(done),
                                          "of " + std::to_string(total) + ": " + std::string(what));
                          });
  }
  const std::string json = evaluation_json(evaluation);
  if (!options.json_file.empty()) {
    if (const auto written = write_file(options.json_file, json); !written) {
      show_error(written.error());
      return Exit::kFailed;
    }
  }
  std::cout << (options.json ? json : evaluation_table(evaluation));
  if (evaluation.rows.empty()) return Exit::kFailed;
  const bool missed = std::ranges::any_of(
      evaluation.rows, [](const auto& row) { return !row.missed.empty() || !row.error.empty(); });
  return options.check && missed ? Exit::kFailed : Exit::kDone;
}

}  // namespace

void add_evaluate(CLI::App& program, Action& action) {
  auto* command = program.add_subcommand(
      "evaluate", "Every estimator on every recording with truth, under every condition");
  auto options = std::make_shared<Options>();
  command->add_option("DIR", options->folder, "Folder with recordings")->capture_default_str();
  command
      ->add_option("--estimator", options->estimators, "Only these: " + names_text<EstimatorName>())
      ->type_name("NAME");
  command->add_option("--condition", options->conditions, "Only these; see the table's legend")
      ->type_name("NAME");
  command->add_flag("--quick", options->quick, "Recordings as they are, no other condition");
  command->add_option("--json-file", options->json_file, "Also write the figures to a file")
      ->type_name("FILE");
  command->add_flag("--json", options->json, "Print the figures as JSON");
  command->add_flag("--check", options->check, "Exit status 1 where a mark is missed");
  command->footer(R"(Examples:
  cutforce evaluate
  cutforce evaluate my/recordings --estimator fused synthesized --quick
  cutforce evaluate --condition no_speed --json)");
  command->callback([options, &action] { action = [options] { return perform(*options); }; });
}

}  // namespace cutforce::firmware::host
