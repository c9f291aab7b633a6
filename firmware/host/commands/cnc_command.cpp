#include <CLI/CLI.hpp>
#include <cmath>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "firmware/host/bench/bench_run.hpp"
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

Examples:
  cutforce cnc --can can0 --arm
  cutforce cnc --can can0 --lathe host_tests/scenarios/bench_lathe.toml --control --out bench.csv
  cutforce cnc --gpio gpiochip0 --data 0,1,2,3,4,5,6,7 --strobe 8 --alive 9 --code fanuc_fv

Exit status: 0 the board did what was asked of it; 1 it was not heard, not armed, or took no control;
2 the command line, the scenario, the interface or the lines are wrong.)";

struct Options {
  std::string can;
  LineChoice lines{.chip = {}, .data = {}, .strobe = 0, .alive = 0, .alarm = -1};
  std::string code = "binary";
  unsigned node = 1;
  std::string lathe;
  unsigned speed_every = kSpeedEvery;
  double duration_s = 0.0;
  double wait_s = 30.0;
  bool no_wait = false;
  double latency_ms = 10.0;
  double timeout_ms = 250.0;
  std::string on_silence = "hold";
  bool arm = false;
  bool control = false;
  bool rearm = false;
  double arm_at_s = 1.5;
  double control_at_s = 2.0;
  double reference_n = 0.0;
  double limit_ratio = 0.0;
  int floor_pct = -1;
  int ceiling_pct = -1;
  unsigned tool = 1;
  bool threading = false;
  std::string out;
  bool json = false;
};

std::int64_t whole_ns(double time_s) { return std::llround(time_s * 1e9); }

OnSilence on_silence_of(const std::string& name) {
  if (name == "keep") return OnSilence::kKeep;
  return name == "programmed" ? OnSilence::kProgrammed : OnSilence::kHold;
}

control::OverrideCode code_of(const std::string& name) {
  const auto found = std::ranges::find(control::kOverrideCodeNames, name);
  return static_cast<control::OverrideCode>(found - control::kOverrideCodeNames.begin());
}

hal::can::Job job_of(const Options& o) {
  const auto given = [](double value) {
    return value > 0.0 ? std::optional{static_cast<float>(value)} : std::nullopt;
  };
  const auto percent = [](int value) {
    return value >= 0 ? std::optional{static_cast<std::uint8_t>(value)} : std::nullopt;
  };
  return {.force_reference_n = given(o.reference_n),
          .force_limit_ratio = given(o.limit_ratio),
          .floor_pct = percent(o.floor_pct),
          .ceiling_pct = percent(o.ceiling_pct),
          .diameter_m = std::nullopt};
}

Bench::Config config_of(const Options& o) {
  return {.node = static_cast<std::uint8_t>(o.node),
          .cnc = {.scan_ns = whole_ns(1e-3 * o.latency_ms),
                  .timeout_ns = whole_ns(1e-3 * o.timeout_ms),
                  .on_silence = on_silence_of(o.on_silence),
                  .arm = o.arm || o.control,
                  .control = o.control,
                  .rearm = o.rearm,
                  .arm_ns = whole_ns(o.arm_at_s),
                  .control_ns = whole_ns(o.control_at_s)},
          .job = job_of(o),
          .tool = static_cast<std::uint8_t>(o.tool),
          .wait_for_board = !o.no_wait,
          .threading = o.threading,
          .code = code_of(o.code),
          .by_lines = !o.lines.chip.empty()};
}

std::optional<InputError> wrong_choice(const Options& o) {
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
  return std::nullopt;
}

template <class Open, class What>
auto opened(const Open& open, const What& what, const std::string& option) -> decltype(open(what)) {
  if (open) return open(what);
  return std::unexpected{InputError{
      option, "this program was built without such a port",
      "use the cutforce of a Linux build (README.md); here the bench runs in tests alone"}};
}

std::expected<std::optional<BenchLathe>, std::vector<InputError>> lathe_of(const Options& o,
                                                                           double& duration_s) {
  if (o.lathe.empty()) return std::nullopt;
  const auto scenario = read_scenario(o.lathe);
  if (!scenario) return std::unexpected{scenario.error()};
  auto lathe = BenchLathe::make(*scenario, static_cast<std::uint8_t>(o.node), o.speed_every);
  if (!lathe) return std::unexpected{std::vector{lathe.error()}};
  if (!(duration_s > 0.0)) duration_s = lathe->duration_s();
  return std::move(*lathe);
}

void show(const BenchResult& result, const Options& o) {
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

Exit perform(const Options& o, const BenchPorts& ports) {
  if (const auto wrong = wrong_choice(o)) return refuse(*wrong);
  double duration_s = o.duration_s;
  auto lathe = lathe_of(o, duration_s);
  if (!lathe) return refuse(lathe.error());
  auto bench = Bench::make(config_of(o), std::move(*lathe));
  if (!bench) return refuse(bench.error());
  std::unique_ptr<CanLink> can;
  std::unique_ptr<LineLink> lines;
  if (!o.can.empty()) {
    auto link = opened(ports.open_can, CanChoice{o.can, config_of(o).node}, "--can");
    if (!link) return refuse(link.error());
    can = std::move(*link);
  }
  if (!o.lines.chip.empty()) {
    auto link = opened(ports.open_lines, o.lines, "--gpio");
    if (!link) return refuse(link.error());
    lines = std::move(*link);
  }
  catch_stop_signals();
  const auto result = run_bench(
      *bench, can.get(), lines.get(),
      {.duration_s = duration_s, .wait_s = o.wait_s, .paced = ports.paced, .trace = o.out});
  if (!result) return refuse(result.error());
  show(*result, o);
  return result->held ? Exit::kDone : Exit::kFailed;
}

void add_wires(CLI::App& command, Options& o) {
  command.add_option("--can", o.can, "CAN interface, such as can0")->type_name("IFACE");
  command.add_option("--node", o.node, "The board's node id")
      ->check(CLI::Range(1U, 127U))
      ->capture_default_str();
  command
      .add_option("--gpio", o.lines.chip,
                  "GPIO chip whose lines carry the override; wins over the one on the bus")
      ->type_name("CHIP");
  command.add_option("--data", o.lines.data, "Offsets of the data lines, bit 0 first")
      ->delimiter(',')
      ->type_name("N,N,...");
  command.add_option("--strobe", o.lines.strobe, "Offset of the strobe line")->type_name("N");
  command.add_option("--alive", o.lines.alive, "Offset of the alive line")->type_name("N");
  command.add_option("--alarm", o.lines.alarm, "Offset of the alarm line")->type_name("N");
  command.add_option("--code", o.code, "Code of the byte")
      ->check(CLI::IsMember(std::vector<std::string>(control::kOverrideCodeNames.begin(),
                                                     control::kOverrideCodeNames.end())))
      ->capture_default_str();
}

void add_cnc_options(CLI::App& command, Options& o) {
  command.add_option("--latency", o.latency_ms, "The CNC's scan of the override")
      ->check(CLI::PositiveNumber)
      ->type_name("MS")
      ->capture_default_str();
  command.add_option("--timeout", o.timeout_ms, "Silence of the board after which it falls back")
      ->check(CLI::PositiveNumber)
      ->type_name("MS")
      ->capture_default_str();
  command
      .add_option("--on-silence", o.on_silence,
                  "What the CNC falls back to where the board had control: hold (the feed), "
                  "keep (the override), programmed (100 %)")
      ->check(CLI::IsMember({"hold", "keep", "programmed"}))
      ->capture_default_str();
  command.add_flag("--arm", o.arm, "Arm the board");
  command.add_flag("--control", o.control, "Arm it and give it control");
  command.add_flag("--rearm", o.rearm, "Acknowledge faults after a second, and arm anew");
  command.add_option("--arm-at", o.arm_at_s, "Not before this time")
      ->type_name("S")
      ->capture_default_str();
  command.add_option("--control-at", o.control_at_s, "Not before this time")
      ->type_name("S")
      ->capture_default_str();
}

void add_job_options(CLI::App& command, Options& o) {
  command.add_option("--reference", o.reference_n, "Force to hold; left out: the board's own")
      ->check(CLI::Range(4.0, 16380.0))
      ->type_name("N");
  command.add_option("--limit", o.limit_ratio, "Force limit over the reference")
      ->check(CLI::Range(1.01, 3.55))
      ->type_name("RATIO");
  command.add_option("--floor", o.floor_pct, "Lowest override")
      ->check(CLI::Range(0, 140))
      ->type_name("PCT");
  command.add_option("--ceiling", o.ceiling_pct, "Highest override")
      ->check(CLI::Range(0, 250))
      ->type_name("PCT");
  command.add_option("--tool", o.tool, "Tool number")
      ->check(CLI::Range(0U, 255U))
      ->capture_default_str();
  command.add_flag("--threading", o.threading, "Say that the feed is bound to the spindle");
}

void add_run_options(CLI::App& command, Options& o) {
  command
      .add_option("--lathe", o.lathe,
                  "Scenario (TOML) of a lathe and its acquisition node on the bus")
      ->type_name("FILE");
  command
      .add_option("--speed-every", o.speed_every, "The lathe's speed goes with each n-th sample")
      ->check(CLI::Range(1U, 100U))
      ->capture_default_str();
  command.add_option("--duration", o.duration_s, "Left out: the scenario's, or until Ctrl-C")
      ->check(CLI::PositiveNumber)
      ->type_name("S");
  command.add_option("--wait", o.wait_s, "How long to wait for the board before time starts")
      ->check(CLI::PositiveNumber)
      ->type_name("S")
      ->capture_default_str();
  command.add_flag("--no-wait", o.no_wait, "Do not wait for the board");
  command.add_option("--out", o.out, "Trace of what was seen (.csv, .csv.gz)")->type_name("FILE");
  command.add_flag("--json", o.json, "Print the closing table as JSON");
}

}  // namespace

void add_cnc(CLI::App& program, Action& action, const BenchPorts& ports) {
  auto* command = program.add_subcommand(
      "cnc", "Plays the CNC, and a lathe if asked, to try the board on a bench");
  auto options = std::make_shared<Options>();
  add_wires(*command, *options);
  add_cnc_options(*command, *options);
  add_job_options(*command, *options);
  add_run_options(*command, *options);
  command->footer(kFooter);
  command->callback([options, &action, &ports] {
    action = [options, &ports] { return perform(*options, ports); };
  });
}

}  // namespace cutforce::firmware::host
