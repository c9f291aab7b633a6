// The scenario as a commented file, and the demo's own.
#include <string>

#include "firmware/host/number_text.hpp"
#include "firmware/host/scenario/scenario.hpp"
#include "firmware/host/scenario/scenario_table.hpp"
#include "firmware/host/toml_check.hpp"

namespace cutforce::firmware::host {
namespace {

std::string number(double value) { return number_text(static_cast<float>(value)); }

struct Writer {
  const ScenarioConfigs& configs;

  std::string operator()(NumberAt at) const { return number(at(configs)); }
  std::string operator()(FlagAt at) const { return at(configs) ? "true" : "false"; }
  std::string operator()(const ChoiceAt& at) const {
    return "\"" + std::string(at.names[at.get(configs)]) + "\"";
  }
  std::string operator()(ProfileAt at) const {
    const auto& points = at(configs).points();
    if (points.size() == 1) return number(points.front().value);
    std::string text;
    for (const auto& point : points) {
      text += (text.empty() ? "[[" : ", [") + number(point.at) + ", " + number(point.value) + "]";
    }
    return text + "]";
  }
  std::string operator()(const ChannelAt& at) const {
    std::string text;
    for (const auto& channel : at.channels(configs)) {
      text += (text.empty() ? "[" : ", ") + number(channel.*at.value);
    }
    return text + "]";
  }
};

// What is allowed, for the comment.
std::string allowed(const ScenarioKey& key) {
  if (std::holds_alternative<FlagAt>(key.at)) return "true or false";
  if (const auto* choice = std::get_if<ChoiceAt>(&key.at)) {
    std::string text;
    for (const auto name : choice->names) {
      text += (text.empty() ? "\"" : ", \"") + std::string(name) + "\"";
    }
    return text;
  }
  std::string text = range_text({.minimum = key.minimum, .maximum = key.maximum, .unit = key.unit});
  if (!key.over.empty()) text += ", one or as points [[" + std::string(key.over) + ", value], ...]";
  return text;
}

constexpr std::string_view kHead =
    R"(# A scenario for `cutforce simulate`. SI units. What is left out is as in the preset.
# A curve is a number, or points [[at, value], ...] joined by straight lines; two points at one
# place make a step.

# Shown above the run.
title = "Simulated run"
)";

constexpr std::string_view kMotorHead =
    R"(# "motor": the machine with its motor, its drive and its signals; "force": see --template=force.
model = "motor"
# The machine to start from: "lathe" (5.5 kW), "motor_a" (2.2 kW), "motor_b" (7.5 kW).
)";

constexpr std::string_view kForceHead =
    R"(# "force": feed, cut and a force sensor, one sample a control period; runs in a millisecond. The
# estimator is the dynamometer.
model = "force"
# The machine to start from.
preset = "lathe"
)";

constexpr std::string_view kHardSpots = R"(
# Hard spots of the material; any number.
# [[process.hard_spots]]
# begin_m = 0.010
# end_m = 0.011
# factor = 1.3
)";

constexpr std::string_view kMotorTail = R"(
# A load that swings; any number.
# [[load.oscillations]]
# begin_s = 2
# end_s = 3
# amplitude_nm = 1
# frequency_hz = 15

# What goes wrong with the signals on their way to the firmware; any number.
# kind: "gap", "stuck", "lost", "swapped", "inverted", "absent".
# channel, other: "voltage_u" "voltage_v" "voltage_w" "current_u" "current_v" "current_w" "speed"
# "power_meter".
# [[faults]]
# kind = "stuck"
# channel = "current_u"
# begin_s = 3
# end_s = 3.5

# The firmware: the sections [estimator] and [control] of a machine file (cutforce check --template).
# [estimator]
# estimator = "fused"
# [control]
# controller = "predictive"
# force_reference_n = 500

# The firmware is given the machine as it is. Where it is to be wrong, say so here: the other
# sections of a machine file, each below `believed`.
# [believed.motor]
# stator_resistance_ohm = 0.9
)";

constexpr std::string_view kForceTail = R"(
# The firmware: the sections [estimator] and [control] of a machine file (cutforce check --template).
# [estimator]
# control_period_s = 0.05
# [control]
# controller = "predictive"
# force_reference_n = 500
)";

constexpr std::string_view kRunKeys =
    "# How long the run is; must be given. 0.01 to 36000 s\nduration_s = 11\n"
    "# Of all that is random. The same seed gives the same run, bit for bit.\nseed = 1\n";

std::string key_texts(Scenario& scenario) {
  const ScenarioConfigs configs(scenario);
  std::string text;
  std::string_view open;
  for (const ScenarioKey& key : scenario_keys(scenario.model)) {
    if (key.section != open) {
      open = key.section;
      text += "\n[" + std::string(open) + "]\n";
      for (const ScenarioSection& section : scenario_sections(scenario.model)) {
        if (section.name == open) text += "# " + std::string(section.sentence) + "\n";
      }
    }
    text += "# " + std::string(key.sentence) + " " + allowed(key) + "\n" + std::string(key.key) +
            " = " + std::visit(Writer{configs}, key.at) + "\n";
  }
  return text;
}

}  // namespace

std::string scenario_template(Preset preset) {
  constexpr std::string_view kNames[] = {"lathe", "motor_a", "motor_b"};
  Scenario scenario{};
  scenario.model = Model::kMotor;
  scenario.simulation = simulation_of(preset);
  std::string text(kHead);
  text += kMotorHead;
  text += "preset = \"" + std::string(kNames[static_cast<std::size_t>(preset)]) + "\"\n";
  text += kRunKeys;
  text += key_texts(scenario);
  text += kHardSpots;
  return text + std::string(kMotorTail);
}

std::string force_scenario_template() {
  Scenario scenario{};
  scenario.model = Model::kForce;
  scenario.force = force_lathe();
  std::string text(kHead);
  text += kForceHead;
  text += kRunKeys;
  text += key_texts(scenario);
  text += kHardSpots;
  return text + std::string(kForceTail);
}

std::string_view demo_scenario_text() {
  return R"(# The demo: longitudinal turning on a 5.5 kW lathe, 1000 rpm, 50 mm, 0.2 mm a turn in steel. The
# tool enters at 1 mm depth of cut; at half of the path the depth steps to 1.5 mm. The predictive law
# sets the feed override so that the estimated cutting force stays at 500 N.
title = "Step in depth of cut, 1 to 1.5 mm"
preset = "lathe"
duration_s = 12
seed = 1
sample_rate_hz = 5000

[process]
depth_m = [[0, 0], [0.003, 0], [0.003, 0.001], [0.015, 0.001], [0.015, 0.0015], [0.027, 0.0015], [0.027, 0]]

# What good industrial sensors do: 12 bit, noise of half a per cent, an offset here and there.
[sensors.voltage]
noise_v = 0.8
range_v = 400
bits = 12
offset_v = [0.6, -0.4, 0.2]
[sensors.current]
noise_a = 0.16
range_a = 100
bits = 12
offset_a = [0.1, -0.15, 0.05]
[sensors.speed]
noise_rad_s = 0.02
[sensors.power_meter]
noise_w = 10

[control]
controller = "predictive"
force_reference_n = 500
)";
}

}  // namespace cutforce::firmware::host
