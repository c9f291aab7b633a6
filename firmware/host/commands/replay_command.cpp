#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "firmware/host/commands/command.hpp"
#include "firmware/host/commands/machine_options.hpp"
#include "firmware/host/commands/progress.hpp"
#include "firmware/host/report/report.hpp"
#include "firmware/host/run/replay.hpp"
#include "firmware/host/write_file.hpp"

namespace cutforce::firmware::host {
namespace {

struct Options {
  std::string recording;
  std::string out;
  MachineOptions machine;
  double rate_hz = 0.0;
  bool json = false;
  bool report = false;
};

Exit write_beside(const RunSummary& summary, const std::filesystem::path& folder) {
  const auto text = summary_json(summary).dump(2) + "\n";
  if (const auto written = write_file(folder / "summary.json", text); !written) {
    show_error(written.error());
    return Exit::kFailed;
  }
  const auto page = write_report(folder.empty() ? std::filesystem::path(".") : folder);
  if (!page) {
    show_error(page.error());
    return Exit::kFailed;
  }
  std::cerr << "report: " << page->string() << "\n";
  return Exit::kDone;
}

Exit perform(const Options& options) {
  catch_stop_signals();
  ReplayRequest request{
      .recording = options.recording, .trace = options.out, .machine = options.machine.request()};
  if (options.rate_hz > 0.0) request.rate_hz = options.rate_hz;
  const auto result = replay(request);
  if (!result) return refuse(result.error());
  const RunSummary& summary = result->summary;
  if (options.json) {
    std::cout << summary_json(summary).dump(2) << "\n";
  } else {
    show_warnings(summary.warnings);
    std::cout << summary.title << ", estimator " << summary.traces.front().name << "\n\n"
              << figure_text(summary.figures);
    if (!summary.verdict.empty()) std::cout << "\n" << summary.verdict << "\n";
    std::cout << "\ntrace: " << options.out << "\n";
  }
  if (options.report) {
    const Exit written = write_beside(summary, request.trace.parent_path());
    if (written != Exit::kDone) return written;
  }
  return result->refused ? Exit::kFailed : Exit::kDone;
}

}  // namespace

void add_replay(CLI::App& program, Action& action) {
  auto* command = program.add_subcommand("replay", "The firmware's loop over recorded signals");
  auto options = std::make_shared<Options>();
  command->add_option("RECORDING", options->recording, ".csv, .csv.gz or .cfr")->required();
  command->add_option("--out", options->out, "Trace to write; .gz packs it")
      ->required()
      ->type_name("TRACE");
  options->machine.add_to(*command);
  command
      ->add_option("--rate", options->rate_hz,
                   "Rows of the trace a second, up to the sample rate; left out: one each "
                   "control tick")
      ->type_name("HZ")
      ->check(CLI::PositiveNumber);
  command->add_flag("--report", options->report,
                    "Also write summary.json and report.html beside the trace");
  command->add_flag("--json", options->json, "Print the summary as JSON");
  command->footer(R"(Examples:
  cutforce replay cut.csv.gz --out trace.csv
  cutforce replay cut.csv --machine lathe.toml --rate 1000 --out out/cut/trace.csv --report
  cutforce replay cut.csv --estimator synthesized --out p3.csv --json

The recording's metadata serve as machine file where there is none. Exit status 1 where the signals
are refused in the end; the trace then says why.)");
  command->callback([options, &action] { action = [options] { return perform(*options); }; });
}

}  // namespace cutforce::firmware::host
