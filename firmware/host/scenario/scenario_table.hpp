// Every key of a scenario file that is one value of the simulated machine, as one table for each
// model: section, key, unit, range, sentence, and where it lives in the machine's config. Feed and
// process are the same config in both models, and so are their keys. The commented template and the
// check with line numbers are read from here.
#pragma once

#include <array>
#include <span>
#include <string_view>
#include <variant>
#include <vector>

#include "firmware/host/scenario/scenario.hpp"

namespace cutforce::firmware::host {

// The configs that keys speak of; feed and process are those of the model's machine.
struct ScenarioConfigs {
  explicit ScenarioConfigs(Scenario& scenario)
      : simulation(scenario.simulation),
        force(scenario.force),
        feed(scenario.model == Model::kForce ? force.feed : simulation.feed),
        process(scenario.model == Model::kForce ? force.process : simulation.process) {}

  hal::host::SimulatedMachineConfig& simulation;
  hal::host::ForceMachineConfig& force;
  hal::host::FeedConfig& feed;
  hal::host::ProcessConfig& process;
};

// Where a value lives. A choice is the position of its name.
using NumberAt = double& (*)(const ScenarioConfigs&);
using FlagAt = bool& (*)(const ScenarioConfigs&);
using ProfileAt = hal::host::Profile& (*)(const ScenarioConfigs&);  // over time, place or speed
struct ChannelAt {  // one number for each of three channels
  std::array<hal::host::ChannelConfig, 3>& (*channels)(const ScenarioConfigs&);
  double hal::host::ChannelConfig::*value;
};
struct ChoiceAt {
  std::span<const std::string_view> names;
  std::size_t (*get)(const ScenarioConfigs&);
  void (*set)(const ScenarioConfigs&, std::size_t);
};

struct ScenarioKey {
  std::string_view section;  // as in the file; empty: before the first section
  std::string_view key;
  std::string_view unit;
  float minimum;
  float maximum;
  std::string_view sentence;
  std::variant<NumberAt, FlagAt, ProfileAt, ChannelAt, ChoiceAt> at;
  std::string_view over = {};  // of a profile: unit of its abscissa
};

// Section by section, in the order of the file.
[[nodiscard]] std::vector<ScenarioKey> scenario_keys(Model model);

struct ScenarioSection {
  std::string_view name;
  std::string_view sentence;
};
[[nodiscard]] std::span<const ScenarioSection> scenario_sections(Model model);

}  // namespace cutforce::firmware::host
