// Every key of a scenario file that is one value of the simulated machine, as one table: section,
// key, unit, range, sentence, and where it lives in the simulated machine's config. The commented
// template and the check with line numbers are read from it.
#pragma once

#include <array>
#include <span>
#include <string_view>
#include <variant>

#include "hal/host/simulation/machine_config.hpp"

namespace cutforce::firmware::host {

using Simulation = hal::host::SimulatedMachineConfig;

// Where a value lives. A choice is the position of its name.
using NumberAt = double& (*)(Simulation&);
using FlagAt = bool& (*)(Simulation&);
using ProfileAt = hal::host::Profile& (*)(Simulation&);  // over time, position or speed
struct ChannelAt {                                       // one number for each of three channels
  std::array<hal::host::ChannelConfig, 3>& (*channels)(Simulation&);
  double hal::host::ChannelConfig::*value;
};
struct ChoiceAt {
  std::span<const std::string_view> names;
  std::size_t (*get)(Simulation&);
  void (*set)(Simulation&, std::size_t);
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
[[nodiscard]] std::span<const ScenarioKey> scenario_keys();

struct ScenarioSection {
  std::string_view name;
  std::string_view sentence;
};
[[nodiscard]] std::span<const ScenarioSection> scenario_sections();

}  // namespace cutforce::firmware::host
