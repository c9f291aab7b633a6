// The keys of a machine without its motor.
#include "firmware/host/scenario/scenario_key.hpp"

namespace cutforce::firmware::host {
namespace {

using namespace scenario_key;

constexpr ScenarioKey kMachineKeys[] = {
    number("", "step_s", "s", 1e-5F, 0.1F,
           "Step of the simulation; the control period is a whole number of them.",
           CUTFORCE_AT(force.step_s)),
    flag("", "starts_in_cut", "true: force and sensor begin settled, at the first override.",
         CUTFORCE_AT(force.starts_in_cut)),

    number("spindle", "programmed_speed_1_s", "1/s", 0.001F, 10000, "Turns a second.",
           CUTFORCE_AT(force.programmed_speed_1_s)),
    profile("spindle", "speed_ratio", "", 0.01F, 100, "s", "Speed against that, over time.",
            CUTFORCE_AT(force.speed_ratio)),
    number("spindle", "gear_ratio", "", 1e-3F, 1000, "Motor turns for each spindle turn.",
           CUTFORCE_AT(force.gear_ratio)),
};

constexpr ScenarioKey kSensorKeys[] = {
    number("sensor", "lag_s", "s", 0, 10, "Time constant.", CUTFORCE_AT(force.sensor.lag_s)),
    number("sensor", "mean_s", "s", 0, 10,
           "Mean over this instead, as over whole turns; 0: the time constant.",
           CUTFORCE_AT(force.sensor.mean_s)),
    number("sensor", "dead_time_s", "s", 0, 10, "Dead time before either.",
           CUTFORCE_AT(force.sensor.dead_time_s)),
    number("sensor", "gain_ratio", "", -100, 100, "Reading = gain * force.",
           CUTFORCE_AT(force.sensor.gain_ratio)),
    number("sensor", "noise_ratio", "", 0, 10, "Standard deviation, as a part of the force.",
           CUTFORCE_AT(force.sensor.noise_ratio)),
    number("sensor", "noise_n", "N", 0, 1e6F, "Standard deviation beside it.",
           CUTFORCE_AT(force.sensor.noise_n)),
    number("sensor", "noise_correlation_s", "s", 0, 10, "How long the noise remembers itself.",
           CUTFORCE_AT(force.sensor.noise_correlation_s)),
    flag("sensor", "speed_present", "Whether the motor's speed is measured.",
         CUTFORCE_AT(force.speed_present)),
    flag("sensor", "override_applied_present", "Whether the CNC reports the override in effect.",
         CUTFORCE_AT(force.override_applied_present)),
};

constexpr ScenarioSection kForceSections[] = {
    {"spindle", "What turns."},
    {"process", "The cut: force from depth, feed and material."},
    {"feed", "From the override to the tool's feed."},
    {"sensor", "How the force is known: a dynamometer, or an estimator by its lag and its noise."},
};

std::vector<ScenarioKey> force_keys() {
  std::vector<ScenarioKey> keys(std::begin(kMachineKeys), std::end(kMachineKeys));
  append(keys, process_keys());
  append(keys, feed_keys());
  append(keys, kSensorKeys);
  return keys;
}

}  // namespace

std::vector<ScenarioKey> scenario_keys(Model model) {
  return model == Model::kForce ? force_keys() : motor_keys();
}

std::span<const ScenarioSection> scenario_sections(Model model) {
  return model == Model::kForce ? std::span<const ScenarioSection>(kForceSections)
                                : motor_sections();
}

}  // namespace cutforce::firmware::host
