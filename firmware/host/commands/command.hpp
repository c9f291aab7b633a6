// The subcommands of the program, one source file each. A command describes itself to the command
// line and leaves what it does as an action, which runs once the whole line has been understood.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "firmware/host/bench/bench_ports.hpp"
#include "hal/host/input_error.hpp"

namespace CLI {
class App;
}

namespace cutforce::firmware::host {

enum class Exit : std::uint8_t {
  kDone = 0,
  kFailed = 1,    // the work failed, or a check did not hold
  kBadInput = 2,  // the input or the command line is wrong
};

using Action = std::function<Exit()>;

void add_demo(CLI::App& program, Action& action);
void add_simulate(CLI::App& program, Action& action);
void add_replay(CLI::App& program, Action& action);
void add_check(CLI::App& program, Action& action);
void add_report(CLI::App& program, Action& action);
void add_lockstep(CLI::App& program, Action& action);
void add_evaluate(CLI::App& program, Action& action);
void add_reproduce(CLI::App& program, Action& action);
void add_convert(CLI::App& program, Action& action);
void add_hash(CLI::App& program, Action& action);
void add_embed(CLI::App& program, Action& action);
void add_tune(CLI::App& program, Action& action);
void add_compare(CLI::App& program, Action& action);
void add_cnc(CLI::App& program, Action& action, const BenchPorts& ports);

// The whole program. Exit status as Exit; 128 + n where signal n ended it. `ports`: what `cnc` may
// open; a composition root that knows an operating system's ports gives them.
[[nodiscard]] int run_program(int argc, const char* const* argv, const BenchPorts& ports = {});

// To standard error, each with its remedy.
void show_errors(std::span<const hal::host::InputError> errors);
void show_error(const hal::host::InputError& error);
void show_warnings(std::span<const std::string> warnings);

// Refused input, as the exit status says it.
[[nodiscard]] Exit refuse(const hal::host::InputError& error);
[[nodiscard]] Exit refuse(std::span<const hal::host::InputError> errors);

}  // namespace cutforce::firmware::host
