#include "firmware/host/scenario/scenario.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <utility>

#include "firmware/host/number_text.hpp"
#include "firmware/host/scenario/scenario_table.hpp"
#include "firmware/host/toml_check.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::Signal;
using hal::host::SignalFaultKind;

constexpr std::array<std::string_view, 2> kModels{"motor", "force"};
constexpr std::array<std::string_view, 3> kPresets{"lathe", "motor_a", "motor_b"};
constexpr std::array<std::string_view, 6> kFaultKinds{"gap",     "stuck",    "lost",
                                                      "swapped", "inverted", "absent"};
// In the order of enum Signal.
constexpr std::array<std::string_view, 8> kChannels{"voltage_u", "voltage_v",  "voltage_w",
                                                    "current_u", "current_v",  "current_w",
                                                    "speed",     "power_meter"};
constexpr float kLongestRunS = 36000.0F;

// The number that the person wrote: 0.0002, not the float nearest to it.
double as_written(float value) {
  const std::string text = number_text(value);
  double number = 0.0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

struct Reader {
  const ScenarioConfigs& configs;
  TomlSection& section;
  const ScenarioKey& key;

  [[nodiscard]] NumberRule rule() const {
    return {.minimum = key.minimum, .maximum = key.maximum, .unit = key.unit};
  }
  void operator()(NumberAt at) const {
    if (const auto value = section.number(key.key, rule())) at(configs) = as_written(*value);
  }
  void operator()(FlagAt at) const {
    if (const auto value = section.flag(key.key)) at(configs) = *value;
  }
  void operator()(const ChoiceAt& at) const {
    if (const auto value = section.choice(key.key, at.names)) at.set(configs, *value);
  }
  void operator()(ProfileAt at) const {
    const auto curve = section.curve(key.key, rule(), key.over);
    if (!curve) return;
    std::vector<hal::host::ProfilePoint> points;
    for (const CurvePoint& point : *curve) {
      points.push_back({as_written(point.at), as_written(point.value)});
    }
    at(configs) = hal::host::Profile(std::move(points));
  }
  void operator()(const ChannelAt& at) const {
    const auto values = section.numbers(key.key, 3, rule());
    if (!values) return;
    for (std::size_t k = 0; k < 3; ++k) {
      at.channels(configs)[k].*at.value = as_written((*values)[k]);
    }
  }
};

// "sensors.speed" is a section within a section.
TomlSection section_at(TomlDocument& document, std::string_view path) {
  TomlSection section = document.root();
  while (!path.empty()) {
    const std::size_t dot = path.find('.');
    section = section.section(path.substr(0, dot));
    path = dot == std::string_view::npos ? std::string_view{} : path.substr(dot + 1);
  }
  return section;
}

double required(TomlSection& section, std::string_view key, const NumberRule& rule) {
  section.require(key, "give " + range_text(rule));
  return as_written(section.number(key, rule).value_or(rule.minimum));
}

void read_hard_spots(TomlDocument& document, hal::host::ProcessConfig& process) {
  const NumberRule place{.minimum = 0, .maximum = 1e4F, .unit = "m"};
  for (TomlSection& spot : section_at(document, "process").sections("hard_spots")) {
    process.hard_spots.push_back(
        {.begin_m = required(spot, "begin_m", place),
         .end_m = required(spot, "end_m", place),
         .factor = required(spot, "factor", {.minimum = 0, .maximum = 100})});
  }
}

void read_motor_lists(TomlDocument& document, hal::host::SimulatedMachineConfig& simulation) {
  const NumberRule time{.minimum = 0, .maximum = kLongestRunS, .unit = "s"};
  for (TomlSection& wave : section_at(document, "load").sections("oscillations")) {
    simulation.load.oscillations.push_back(
        {.begin_s = required(wave, "begin_s", time),
         .end_s = required(wave, "end_s", time),
         .amplitude_nm =
             required(wave, "amplitude_nm", {.minimum = 0, .maximum = 1e6F, .unit = "N m"}),
         .frequency_hz =
             required(wave, "frequency_hz", {.minimum = 0, .maximum = 1e4F, .unit = "Hz"})});
  }
  for (TomlSection& entry : document.root().sections("faults")) {
    hal::host::SignalFault fault{};
    entry.require("kind", "give what goes wrong");
    fault.kind = static_cast<SignalFaultKind>(entry.choice("kind", kFaultKinds).value_or(0));
    if (const auto begin = entry.number("begin_s", time)) fault.begin_s = as_written(*begin);
    if (const auto end = entry.number("end_s", time)) fault.end_s = as_written(*end);
    const bool gap = fault.kind == SignalFaultKind::kGap;
    if (gap) entry.require("end_s", "a gap has an end: give it in s");
    if (!gap) entry.require("channel", "give the channel that it happens to");
    fault.channel = static_cast<Signal>(entry.choice("channel", kChannels).value_or(0));
    if (fault.kind == SignalFaultKind::kSwapped) entry.require("other", "give the other channel");
    fault.other = static_cast<Signal>(entry.choice("other", kChannels).value_or(0));
    if (!(fault.end_s > fault.begin_s)) {
      entry.refuse("end_s", "the fault ends before it begins", "give end_s above begin_s");
    }
    simulation.faults.push_back(fault);
  }
}

// Errors of the simulation's own check name a key, which the document can place.
InputError placed(TomlDocument& document, const InputError& error) {
  const std::size_t dot = error.where.rfind('.');
  const bool in_section = dot != std::string::npos;
  std::string key = in_section ? error.where.substr(dot + 1) : error.where;
  if (const std::size_t bracket = key.find('['); bracket != std::string::npos) key.resize(bracket);
  const std::string path = in_section ? error.where.substr(0, dot) : std::string();
  TomlSection section = section_at(document, error.where == "friction_ratio" ? "spindle" : path);
  return {section.where(key), error.where + " " + error.what, error.remedy};
}

void read_configs(TomlDocument& document, Scenario& scenario) {
  const ScenarioConfigs configs(scenario);
  std::string_view open = "?";
  std::optional<TomlSection> section;
  for (const ScenarioKey& key : scenario_keys(scenario.model)) {
    if (key.section != open) section = section_at(document, key.section);
    open = key.section;
    std::visit(Reader{configs, *section, key}, key.at);
  }
  read_hard_spots(document, configs.process);
  if (scenario.model == Model::kMotor) read_motor_lists(document, scenario.simulation);
  // A feed given in the other way takes the preset's place.
  TomlSection feed = document.section("feed");
  if (feed.has("feed_m_s") && !feed.has("feed_m_rev")) configs.feed.feed_m_rev = 0.0;
  if (feed.has("feed_m_rev") && !feed.has("feed_m_s")) configs.feed.feed_m_s = 0.0;
  TomlSection machine = document.root();
  if (const auto seed = machine.whole("seed", 1, 2147483647)) {
    scenario.simulation.seed = scenario.force.seed = static_cast<std::uint64_t>(*seed);
  }
}

// What control and simulation share is given once: the period, and the override at the start.
void follow_control(TomlDocument& document, Scenario& scenario, MachineFile& believed) {
  Machine& m = believed.machine;
  TomlSection estimator = document.section("estimator");
  if (m.estimator != EstimatorName::kDynamometer) {
    // The document places what it holds; what it does not hold the command line gave.
    const std::string where =
        estimator.has("estimator") ? estimator.where("estimator") : "--estimator";
    believed.errors.push_back({where,
                               "a machine without its motor has no signals for this estimator",
                               "leave it out, or choose dynamometer, or model = \"motor\""});
  }
  TomlSection signals = section_at(document, "believed.signals");
  for (auto* section : {&estimator, &signals}) {
    for (const std::string_view key : {"estimate_period_s", "sample_rate_hz"}) {
      if (!section->has(key)) continue;
      section->refuse(key, "there is one force a control period",
                      "leave it out; control_period_s says how often");
    }
  }
  m.estimator = EstimatorName::kDynamometer;
  m.estimate_period_s = m.control_period_s;
  m.sample_rate_hz = 1.0F / m.control_period_s;
  scenario.force.sample_s = as_written(m.control_period_s);
  if (!document.section("feed").has("initial_override_pct")) {
    scenario.force.feed.initial_override_pct = as_written(m.override_initial_pct);
  }
}

std::expected<void, InputError> check(const Scenario& scenario) {
  return scenario.model == Model::kForce ? scenario.force.check() : scenario.simulation.check();
}

// What the firmware is given: the machine as it is, and what the file says of control and belief.
MachineFile believed_machine(TomlDocument& document, Scenario& scenario, const std::string& name,
                             std::span<const MachineOption> options) {
  MachineFile believed{};
  believed.name = name;
  const auto controls = [](Section s) { return s >= Section::kEstimator; };
  const auto others = [](Section s) { return s < Section::kEstimator; };
  const bool force = scenario.model == Model::kForce;
  believed.machine =
      force ? machine_of(scenario.force) : machine_of(scenario.simulation, scenario.preset);
  for (std::size_t k = 0; k < kParameters.size(); ++k) {
    if (kParameters[k].section < Section::kEstimator) believed.where[k] = name;
  }
  fill_sections(believed, document.root(), controls);
  fill_sections(believed, document.root().section("believed"), others);
  for (const MachineOption& option : options) {
    set_value(believed, option.key, option.value, option.option);
  }
  if (force) follow_control(document, scenario, believed);
  return believed;
}

std::expected<Scenario, std::vector<InputError>> read(TomlDocument& document, std::string name,
                                                      std::span<const MachineOption> options) {
  Scenario scenario{};
  TomlSection root = document.root();
  scenario.title = root.text("title").value_or("Simulated run");
  scenario.model = static_cast<Model>(root.choice("model", kModels).value_or(0));
  const bool force = scenario.model == Model::kForce;
  const auto presets = std::span(kPresets).first(force ? 1 : kPresets.size());
  scenario.preset = static_cast<Preset>(root.choice("preset", presets).value_or(0));
  scenario.simulation = simulation_of(scenario.preset);
  scenario.force = force_lathe();
  scenario.duration_s =
      required(root, "duration_s", {.minimum = 0.01F, .maximum = kLongestRunS, .unit = "s"});
  read_configs(document, scenario);
  MachineFile believed = believed_machine(document, scenario, name, options);

  std::vector<InputError> errors = document.finish();
  if (errors.empty()) {
    if (const auto checked = check(scenario); !checked) {
      errors.push_back(placed(document, checked.error()));
    }
  }
  if (!errors.empty()) return std::unexpected{std::move(errors)};
  auto loaded = complete(std::move(believed));
  if (!loaded) return std::unexpected{std::move(loaded.error())};
  scenario.machine = loaded->machine;
  scenario.warnings = std::move(loaded->warnings);
  return scenario;
}

}  // namespace

std::expected<Scenario, std::vector<InputError>> read_scenario(
    const std::filesystem::path& path, std::span<const MachineOption> options) {
  auto document = TomlDocument::read(path);
  if (!document) return std::unexpected{std::vector{document.error()}};
  return read(**document, path.string(), options);
}

std::expected<Scenario, std::vector<InputError>> parse_scenario(
    std::string_view text, std::string name, std::span<const MachineOption> options) {
  auto document = TomlDocument::parse(text, name);
  if (!document) return std::unexpected{std::vector{document.error()}};
  return read(**document, std::move(name), options);
}

bool is_scenario(const std::filesystem::path& path) {
  const auto document = TomlDocument::read(path);
  if (!document) return false;
  TomlSection root = (*document)->root();
  // The others are sections of a machine file too.
  constexpr std::array<std::string_view, 16> kOwn{
      "title",    "model",    "preset", "duration_s",   "seed", "sample_rate_hz",
      "inverter", "drive",    "feed",   "process",      "load", "sensors",
      "sensor",   "believed", "step_s", "starts_in_cut"};
  return std::ranges::any_of(kOwn, [&](std::string_view key) { return root.has(key); });
}

}  // namespace cutforce::firmware::host
