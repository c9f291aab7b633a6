#include "firmware/host/commands/machine_options.hpp"

namespace cutforce::firmware::host {

void BlockOptions::add_to(CLI::App& command, const std::string& over) {
  command
      .add_option("--estimator", estimator, names_text<EstimatorName>() + "; it wins over " + over)
      ->type_name("NAME");
  command
      .add_option("--controller", controller,
                  names_text<ControllerName>() + "; it wins over " + over)
      ->type_name("NAME");
}

std::vector<MachineOption> BlockOptions::options() const {
  std::vector<MachineOption> options;
  if (!estimator.empty()) options.push_back({"--estimator", "estimator", estimator});
  if (!controller.empty()) options.push_back({"--controller", "controller", controller});
  return options;
}

void MachineOptions::add_to(CLI::App& command) {
  command.add_option("--machine", file, "Machine file (TOML); it wins over the recording")
      ->type_name("FILE");
  blocks.add_to(command, "the machine file");
}

MachineRequest MachineOptions::request() const {
  return {.machine_file = file, .options = blocks.options()};
}

}  // namespace cutforce::firmware::host
