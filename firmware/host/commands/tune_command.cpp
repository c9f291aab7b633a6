#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "firmware/host/commands/command.hpp"
#include "firmware/host/commands/progress.hpp"
#include "firmware/host/design/design_text.hpp"
#include "firmware/host/design/tuning.hpp"
#include "firmware/host/write_file.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::InputError;

struct Options {
  std::string recording;
  std::optional<double> gain_n_pct;
  std::optional<double> lag_s;
  std::optional<double> latency_s;
  std::optional<double> exponent;
  double feed_lag_s = 0.0;
  double sensor_lag_s = 0.0;
  double reference_n = 500.0;
  double settling_s = 0.6;
  double period_s = 0.05;
  double from_s = 0.0;
  double to_s = std::numeric_limits<double>::infinity();
  std::string controller = "predictive";
  std::string page;
  bool json = false;
};

struct Limits {
  double low;
  double high;
};

// NaN is within nothing.
std::optional<InputError> outside(const char* option, double value, Limits limits,
                                  const char* remedy) {
  if (value >= limits.low && value <= limits.high) return {};
  return InputError{option,
                    std::isnan(value) ? "this is not a number"
                                      : std::to_string(value) + " is outside " + brief(limits.low) +
                                            " to " + brief(limits.high),
                    remedy};
}

std::optional<InputError> wrong_number(const Options& o) {
  struct Check {
    const char* option;
    double value;
    Limits limits;
    const char* remedy;
  };
  constexpr const char* kLag = "give seconds; 0 where there is none";
  const std::vector<Check> checks{
      {"--gain",
       o.gain_n_pct.value_or(1.0),
       {1e-4, 1e4},
       "give N per % of override, above 0: the force rises with the feed"},
      {"--lag", o.lag_s.value_or(0.0), {0.0, 10.0}, kLag},
      {"--latency", o.latency_s.value_or(0.0), {0.0, 5.0}, kLag},
      {"--exponent", o.exponent.value_or(1.0), {0.1, 3.0}, "give 1, or 0.8 to 0.9 for most cuts"},
      {"--feed-lag", o.feed_lag_s, {0.0, 10.0}, kLag},
      {"--sensor-lag", o.sensor_lag_s, {0.0, 10.0}, kLag},
      {"--reference", o.reference_n, {1.0, 1e5}, "give the force to hold, in N"},
      {"--settling", o.settling_s, {1e-3, 100.0}, "give seconds, above 0"},
      {"--period", o.period_s, {1e-3, 0.5}, "give the control period in seconds; 0.05 is usual"},
  };
  for (const auto& check : checks) {
    if (auto error = outside(check.option, check.value, check.limits, check.remedy)) return error;
  }
  if (std::isnan(o.from_s) || !(o.from_s < o.to_s))
    return InputError{"--from", "the stretch has no length", "give --from below --to, in seconds"};
  return {};
}

std::optional<InputError> wrong_source(const Options& o) {
  const bool given = o.gain_n_pct || o.lag_s || o.latency_s || o.exponent;
  if (!o.recording.empty() && given)
    return InputError{"RECORDING", "the plant is given twice, as a recording and as numbers",
                      "leave out --gain, --lag, --latency and --exponent, or the recording"};
  if (o.recording.empty() && !(o.gain_n_pct && o.lag_s && o.latency_s))
    return InputError{"cutforce tune", "the plant is not known",
                      "name the recording of an override step test, or give --gain, --lag and "
                      "--latency"};
  return {};
}

std::expected<std::vector<std::string_view>, InputError> chosen(const std::string& name) {
  const auto known = tunable_controllers();
  if (name == "all") return std::vector<std::string_view>(known.begin(), known.end());
  const auto found = std::ranges::find(known, name);
  if (found != known.end()) return std::vector<std::string_view>{*found};
  std::string names;
  for (const auto& one : known) names += std::string(one) + ", ";
  return std::unexpected(
      InputError{"--controller", "there is none named " + name, "give one of " + names + "or all"});
}

std::expected<Identification, InputError> identification(const Options& o) {
  auto test = read_step_test(o.recording, {.from_s = o.from_s, .to_s = o.to_s});
  if (!test) return std::unexpected(test.error());
  const auto plant = identify(*test, {o.feed_lag_s, o.sensor_lag_s});
  if (!plant) return std::unexpected(plant.error());
  constexpr double kSpacing_s = 0.04;
  auto bank = latency_bank(*test, *plant, o.period_s, kSpacing_s);
  return Identification{.test = std::move(*test), .plant = *plant, .bank = bank};
}

Exit perform(const Options& o) {
  catch_stop_signals();
  const auto controllers = chosen(o.controller);
  if (!controllers) return refuse(controllers.error());
  if (const auto error = wrong_number(o)) return refuse(*error);
  if (const auto error = wrong_source(o)) return refuse(*error);

  LoopPlant plant{.gain_n_pct = o.gain_n_pct.value_or(0.0),
                  .exponent = o.exponent.value_or(1.0),
                  .lag_s = o.lag_s.value_or(0.0),
                  .latency_s = o.latency_s.value_or(0.0),
                  .feed_lag_s = o.feed_lag_s,
                  .sensor_lag_s = o.sensor_lag_s,
                  .reference_n = o.reference_n};
  std::optional<Identification> found;
  if (!o.recording.empty()) {
    auto identified = identification(o);
    if (!identified) return refuse(identified.error());
    plant = plant_at(identified->plant, o.reference_n);
    found = std::move(*identified);
  }
  const auto tuning = tune(plant, {.settling_s = o.settling_s, .period_s = o.period_s},
                           std::move(found), *controllers);
  if (!o.page.empty()) {
    if (const auto written = write_file(o.page, tuning_page(tuning)); !written) {
      show_error(written.error());
      return Exit::kFailed;
    }
  }
  std::cout << (o.json ? tuning_json(tuning).dump(2) + "\n" : tuning_text(tuning));
  return tuning.proposals.empty() ? Exit::kFailed : Exit::kDone;
}

}  // namespace

void add_tune(CLI::App& program, Action& action) {
  auto* command = program.add_subcommand(
      "tune", "Gains from a step test of the override, or from a known plant, with margins");
  auto o = std::make_shared<Options>();
  const auto option = [&](const char* name, auto& value, const char* unit, const char* text) {
    return command->add_option(name, value, text)->type_name(unit);
  };
  command->add_option("RECORDING", o->recording,
                      "Step test: t_s, override_pct, and measured_force_n or cutting_force_n");
  option("--gain", o->gain_n_pct, "N/%", "Force for each % of override, at the force to hold");
  option("--lag", o->lag_s, "S", "Time constant of the cut");
  option("--latency", o->latency_s, "S", "Dead time from the override to the feed");
  option("--exponent", o->exponent, "P", "Of the force on the feed; 1 where not given");
  option("--feed-lag", o->feed_lag_s, "S", "Time constant of the feed drive, where known");
  option("--sensor-lag", o->sensor_lag_s, "S", "Time constant of the force signal, where known");
  option("--reference", o->reference_n, "N", "Force to hold")->capture_default_str();
  option("--settling", o->settling_s, "S", "Wished time to within 5 %")->capture_default_str();
  option("--period", o->period_s, "S", "Control period")->capture_default_str();
  option("--from", o->from_s, "S", "Use the recording from here");
  option("--to", o->to_s, "S", "Use the recording up to here");
  option("--controller", o->controller, "NAME",
         "pi, pid, pole_assignment, variable_gain, fuzzy, mrac, predictive, or all")
      ->capture_default_str();
  option("--out", o->page, "FILE.html", "Also write a page with step responses");
  command->add_flag("--json", o->json, "Print everything as JSON");
  command->footer(R"(Examples:
  cutforce tune steps.csv --settling 0.8 --controller all --out tuning.html
  cutforce tune --gain 4 --lag 0.1 --latency 0.05 --controller pi

A step test: in a cut of constant depth, change the override by 20 % or more and back, five times
or more, each time waiting until the force is at rest. Record the override that is sent: what the
CNC reports comes later, and the time in between would be missing from the dead time.)");
  command->callback([o, &action] { action = [o] { return perform(*o); }; });
}

}  // namespace cutforce::firmware::host
