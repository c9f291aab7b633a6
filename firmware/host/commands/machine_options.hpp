// Options that choose or overrule a machine, shared by the commands that run the loop.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "firmware/host/run/recorded_machine.hpp"

namespace cutforce::firmware::host {

struct MachineOptions {
  std::string file;
  std::string estimator;
  std::string controller;

  void add_to(CLI::App& command);
  [[nodiscard]] MachineRequest request() const;
};

// "measured, computed, ..." for help texts.
template <class Enum>
[[nodiscard]] std::string names_text() {
  std::string text;
  for (const auto name : kNames<Enum>) text += (text.empty() ? "" : ", ") + std::string(name);
  return text;
}

}  // namespace cutforce::firmware::host
