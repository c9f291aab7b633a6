#include "firmware/host/commands/machine_options.hpp"

namespace cutforce::firmware::host {

void MachineOptions::add_to(CLI::App& command) {
  command.add_option("--machine", file, "Machine file (TOML); it wins over the recording")
      ->type_name("FILE");
  command
      .add_option("--estimator", estimator,
                  names_text<EstimatorName>() + "; it wins over the machine file")
      ->type_name("NAME");
  command
      .add_option("--controller", controller,
                  names_text<ControllerName>() + "; it wins over the machine file")
      ->type_name("NAME");
}

MachineRequest MachineOptions::request() const {
  MachineRequest request{.machine_file = file, .options = {}};
  if (!estimator.empty()) request.options.push_back({"--estimator", "estimator", estimator});
  if (!controller.empty()) request.options.push_back({"--controller", "controller", controller});
  return request;
}

}  // namespace cutforce::firmware::host
