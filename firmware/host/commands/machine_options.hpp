// Options that choose or overrule a machine, shared by the commands that run the loop.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <vector>

#include "firmware/host/run/recorded_machine.hpp"

namespace cutforce::firmware::host {

// What computes, for every command that runs the loop.
struct BlockOptions {
  std::string estimator;
  std::string controller;

  // `over` is what they win over, "the machine file".
  void add_to(CLI::App& command, const std::string& over);
  [[nodiscard]] std::vector<MachineOption> options() const;
};

struct MachineOptions {
  std::string file;
  BlockOptions blocks;

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
