#include "firmware/host/commands/cnc_options.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

namespace cutforce::firmware::host {
namespace {

std::int64_t whole_ns(double time_s) { return std::llround(time_s * 1e9); }

OnSilence on_silence_of(const std::string& name) {
  if (name == "keep") return OnSilence::kKeep;
  return name == "programmed" ? OnSilence::kProgrammed : OnSilence::kHold;
}

control::OverrideCode code_of(const std::string& name) {
  const auto found = std::ranges::find(control::kOverrideCodeNames, name);
  return static_cast<control::OverrideCode>(found - control::kOverrideCodeNames.begin());
}

hal::can::Job job_of(const CncOptions& o) {
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

void add_line(CLI::App& command, const char* name, int& line, const char* text) {
  command.add_option(name, line, text)->check(CLI::Range(0, 4095))->type_name("N");
}

void add_wires(CLI::App& command, CncOptions& o) {
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
  add_line(command, "--strobe", o.lines.strobe,
           "Offset of the strobe line: the byte is taken at its active edge");
  add_line(command, "--alive", o.lines.alive,
           "Offset of the alive line; left out: each strobed byte is a sign of life");
  add_line(command, "--alarm", o.lines.alarm, "Offset of the alarm line");
  command.add_flag("--data-active-low", o.lines.data_active_low, "The data lines are turned over");
  command.add_option("--active-low", o.lines.active_low, "Which of the other lines are")
      ->delimiter(',')
      ->type_name("N,N,...");
  command.add_option("--code", o.code, "Code of the byte")
      ->check(CLI::IsMember(std::vector<std::string>(control::kOverrideCodeNames.begin(),
                                                     control::kOverrideCodeNames.end())))
      ->capture_default_str();
}

void add_inhibit(CLI::App& command, CncOptions& o) {
  add_line(command, "--inhibit", o.lines.inhibit,
           "Offset of the line by which the CNC forbids control: an output");
  command.add_option("--inhibit-at", o.inhibit_at_s, "From this time on it does")
      ->check(CLI::NonNegativeNumber)
      ->type_name("S")
      ->capture_default_str();
  command.add_option("--inhibit-for", o.inhibit_for_s, "For so long")
      ->check(CLI::PositiveNumber)
      ->type_name("S")
      ->capture_default_str();
}

void add_cnc_options(CLI::App& command, CncOptions& o) {
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

void add_job_options(CLI::App& command, CncOptions& o) {
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

void add_run_options(CLI::App& command, CncOptions& o) {
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
  command.add_flag("--abrupt", o.abrupt,
                   "End in the midst, as if the cable were pulled, without arm and control low");
}

}  // namespace

Bench::Config CncOptions::bench() const {
  const CncOptions& o = *this;
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
          .by_lines = !o.lines.chip.empty(),
          .has_alive = o.lines.alive >= 0,
          .inhibit_ns = whole_ns(o.inhibit_at_s),
          .inhibit_end_ns =
              whole_ns(o.lines.inhibit < 0 ? o.inhibit_at_s : o.inhibit_at_s + o.inhibit_for_s)};
}

void CncOptions::add_to(CLI::App& command) {
  add_wires(command, *this);
  add_inhibit(command, *this);
  add_cnc_options(command, *this);
  add_job_options(command, *this);
  add_run_options(command, *this);
}

}  // namespace cutforce::firmware::host
