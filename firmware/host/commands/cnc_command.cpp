#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "firmware/host/bench/bench_run.hpp"
#include "firmware/host/commands/cnc_options.hpp"
#include "firmware/host/commands/command.hpp"
#include "firmware/host/commands/progress.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::InputError;
using Json = nlohmann::ordered_json;

constexpr const char* kFooter =
    R"(It sends MachineState and Job, applies the override that comes back, and shows what it hears. With
--lathe a simulated lathe and its acquisition node are on the bus too: the loop closes over the wires.

The CNC takes the newest override over each --latency milliseconds of sample time: an answer that is
quicker than that takes effect at the same instant, however much it jitters. When the board has been
silent for --timeout, the CNC falls back and says to what.

With --gpio the byte on the lines is the override, taken at the strobe's active edge. Without --alive
each strobed byte is a sign of life; the board strobes changes only, so give a --timeout for that.

In the end five more MachineStates say that arm and control are low, so that the board gives the feed
back before it misses the link; with --abrupt they do not come.

Examples:
  cutforce cnc --can can0 --arm
  cutforce cnc --can can0 --lathe host_tests/scenarios/bench_lathe.toml --control --out bench.csv
  cutforce cnc --gpio gpiochip0 --data 0,1,2,3,4,5,6,7 --strobe 8 --alive 9 --code fanuc_fv

Exit status: 0 the board did what was asked of it; 1 it was not heard, not armed, or took no control;
2 the command line, the scenario, the interface or the lines are wrong.)";

std::optional<InputError> wrong_choice(const CncOptions& o) {
  if (o.can.empty() && o.lines.chip.empty()) {
    return InputError{"cutforce cnc", "nothing is named that the board is connected to",
                      "give --can IFACE, or --gpio CHIP, or both"};
  }
  if (!o.lathe.empty() && o.can.empty()) {
    return InputError{"--lathe", "the lathe's signals go to the board over the bus alone",
                      "give --can IFACE too"};
  }
  if (!o.lines.chip.empty() && o.lines.data.size() != 8 && o.lines.data.size() != 4) {
    return InputError{"--data", "there are not eight data lines, nor four for fanuc_ov_10",
                      "name the offsets on the chip, bit 0 first: --data 0,1,2,3,4,5,6,7"};
  }
  if (o.lines.data.size() == 4 && o.code != "fanuc_ov_10") {
    return InputError{"--data", "four data lines do not carry the code " + o.code,
                      "name eight lines, or give --code fanuc_ov_10"};
  }
  if (!o.lines.chip.empty() && o.lines.strobe < 0) {
    return InputError{"--strobe", "there is no strobe line, and without one no byte is whole",
                      "name the line on which the board strobes: --strobe 8"};
  }
  if (o.lines.chip.empty() && (o.lines.strobe >= 0 || o.lines.inhibit >= 0)) {
    return InputError{"--gpio", "lines are named, but not on which chip",
                      "give --gpio CHIP, such as gpiochip0 (see gpiodetect)"};
  }
  return std::nullopt;
}

template <class Open, class What>
auto opened(const Open& open, const What& what, const std::string& option) -> decltype(open(what)) {
  if (open) return open(what);
  return std::unexpected{InputError{
      option, "this program was built without such a port",
      "use the cutforce of a Linux build (README.md); here the bench runs in tests alone"}};
}

std::expected<std::optional<BenchLathe>, std::vector<InputError>> lathe_of(const CncOptions& o,
                                                                           double& duration_s) {
  if (o.lathe.empty()) return std::nullopt;
  const auto scenario = read_scenario(o.lathe);
  if (!scenario) return std::unexpected{scenario.error()};
  auto lathe = BenchLathe::make(*scenario, static_cast<std::uint8_t>(o.node), o.speed_every);
  if (!lathe) return std::unexpected{std::vector{lathe.error()}};
  if (!(duration_s > 0.0)) duration_s = lathe->duration_s();
  return std::move(*lathe);
}

void show(const BenchResult& result, const CncOptions& o) {
  if (o.json) {
    Json json{{"verdict", result.verdict}, {"held", result.held}};
    for (const Figure& figure : result.figures) {
      std::visit([&](const auto& value) { json["figures"][figure.key] = value; }, figure.value);
    }
    json["events"] = Json::array();
    for (const Event& event : result.events) {
      json["events"].push_back({{"t_s", event.time_s}, {"text", event.text}});
    }
    std::cout << json.dump(2) << "\n";
    return;
  }
  for (const Event& event : result.events) {
    std::printf("  %9.3f s  %s\n", event.time_s, event.text.c_str());
  }
  std::fflush(stdout);
  std::cout << "\n" << figure_text(result.figures) << "\n" << result.verdict << "\n";
}

Exit perform(const CncOptions& o, const BenchPorts& ports) {
  if (const auto wrong = wrong_choice(o)) return refuse(*wrong);
  double duration_s = o.duration_s;
  auto lathe = lathe_of(o, duration_s);
  if (!lathe) return refuse(lathe.error());
  auto bench = Bench::make(o.bench(), std::move(*lathe));
  if (!bench) return refuse(bench.error());
  std::unique_ptr<CanLink> can;
  std::unique_ptr<LineLink> lines;
  if (!o.can.empty()) {
    auto link = opened(ports.open_can, CanChoice{o.can, o.bench().node}, "--can");
    if (!link) return refuse(link.error());
    can = std::move(*link);
  }
  if (!o.lines.chip.empty()) {
    auto link = opened(ports.open_lines, o.lines, "--gpio");
    if (!link) return refuse(link.error());
    lines = std::move(*link);
  }
  catch_stop_signals();
  const auto result = run_bench(*bench, can.get(), lines.get(),
                                {.duration_s = duration_s,
                                 .wait_s = o.wait_s,
                                 .paced = ports.paced,
                                 .abrupt = o.abrupt,
                                 .trace = o.out});
  if (!result) return refuse(result.error());
  show(*result, o);
  return result->held ? Exit::kDone : Exit::kFailed;
}

}  // namespace

void add_cnc(CLI::App& program, Action& action, const BenchPorts& ports) {
  auto* command = program.add_subcommand(
      "cnc", "Plays the CNC, and a lathe if asked, to try the board on a bench");
  auto options = std::make_shared<CncOptions>();
  options->add_to(*command);
  command->footer(kFooter);
  command->callback([options, &action, &ports] {
    action = [options, &ports] { return perform(*options, ports); };
  });
}

}  // namespace cutforce::firmware::host
