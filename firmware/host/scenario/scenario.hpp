// A scenario: a simulated machine, what it does, how long, and what the firmware believes of it.
// A person writes it as TOML, on top of a preset; the firmware's machine follows from the simulated
// one as a faultless commissioning would find it, and [believed.*] says where that is wrong.
//
//   auto scenario = read_scenario(path);          // or every error, with line, column and remedy
//   auto machine = SimulatedMachine::make(scenario->simulation);
//
// Two models: with the motor, its drive and its signals (the whole chain of estimation), or without
// (`model = "force"`: feed, cut and a force sensor, one sample a control period; the estimator is
// the dynamometer). Feed and cut are the same in both.
#pragma once

#include <cstdint>
#include <expected>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/host/machine_file.hpp"
#include "firmware/machine.hpp"
#include "hal/host/input_error.hpp"
#include "hal/host/simulation/force_machine.hpp"
#include "hal/host/simulation/machine_config.hpp"

namespace cutforce::firmware::host {

enum class Preset : std::uint8_t { kLathe, kMotorA, kMotorB };
enum class Model : std::uint8_t { kMotor, kForce };

struct Scenario {
  std::string title;
  Model model;
  Preset preset;
  double duration_s;
  hal::host::SimulatedMachineConfig simulation;  // of Model::kMotor
  hal::host::ForceMachineConfig force;           // of Model::kForce
  Machine machine;                               // what the firmware is given; complete and checked
  std::vector<std::string> warnings;             // one line each
};

[[nodiscard]] hal::host::SimulatedMachineConfig simulation_of(Preset preset);
// What a force scenario starts from: the lathe of the comparison, its sensor free of noise.
[[nodiscard]] hal::host::ForceMachineConfig force_lathe();

// The firmware's parameters of a simulated machine: star-equivalent inverse-Gamma values at rated
// flux, friction at the support speeds, and the sensors that are there. Control and estimation stay
// the default machine's.
[[nodiscard]] Machine machine_of(const hal::host::SimulatedMachineConfig& simulation,
                                 Preset preset);
// Likewise without a motor: the default machine with a dynamometer.
[[nodiscard]] Machine machine_of(const hal::host::ForceMachineConfig& force);

// The options win over the file.
[[nodiscard]] std::expected<Scenario, std::vector<InputError>> read_scenario(
    const std::filesystem::path& path, std::span<const MachineOption> options = {});
[[nodiscard]] std::expected<Scenario, std::vector<InputError>> parse_scenario(
    std::string_view text, std::string name, std::span<const MachineOption> options = {});

// Whether a TOML file holds a scenario, not a machine: by the keys before and of its sections. No
// scenario where it cannot be read.
[[nodiscard]] bool is_scenario(const std::filesystem::path& path);

// A commented file with every key, of the preset's values.
[[nodiscard]] std::string scenario_template(Preset preset);
[[nodiscard]] std::string force_scenario_template();

// The demo: a step in depth of cut from 1 to 1.5 mm on the default lathe.
[[nodiscard]] std::string_view demo_scenario_text();

}  // namespace cutforce::firmware::host
