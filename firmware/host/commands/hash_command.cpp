#include <CLI/CLI.hpp>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "firmware/host/commands/command.hpp"
#include "firmware/host/commands/machine_options.hpp"
#include "firmware/host/run/digest.hpp"

namespace cutforce::firmware::host {
namespace {

struct Options {
  std::vector<std::string> files;
  std::string streams;
  BlockOptions blocks;
};

// "cut_fused_pi" of cut.csv.gz and options: it names the run, in the output and as a stream.
std::string name_of(const std::filesystem::path& file, const BlockOptions& blocks) {
  std::string name = file.filename().string();
  name.erase(std::min(name.find('.'), name.size()));
  for (const std::string& choice : {blocks.estimator, blocks.controller}) {
    if (!choice.empty()) name += "_" + choice;
  }
  return name;
}

Exit perform(const Options& options) {
  for (const std::string& file : options.files) {
    const std::string name = name_of(file, options.blocks);
    DigestRequest request{.file = file, .options = options.blocks.options()};
    if (!options.streams.empty()) {
      request.stream = std::filesystem::path(options.streams) / (name + ".stream");
    }
    const auto result = digest_of(request);
    if (!result) return refuse(result.error());
    std::cout << name << " outputs " << result->digest.outputs() << std::hex << std::setfill('0')
              << " override " << std::setw(16) << result->digest.override_hash() << " trace "
              << std::setw(16) << result->digest.trace_hash() << std::dec << "\n";
  }
  return Exit::kDone;
}

}  // namespace

void add_hash(CLI::App& program, Action& action) {
  auto* command =
      program.add_subcommand("hash", "The loop's outputs as two numbers, to compare machines by");
  auto options = std::make_shared<Options>();
  command->add_option("FILE", options->files, "Recordings and scenarios (.toml)")->required();
  command
      ->add_option("--streams", options->streams,
                   "Also write the samples to this folder, as the bare-metal image reads them")
      ->type_name("DIR")
      ->check(CLI::ExistingDirectory);
  options->blocks.add_to(*command, "the recording or scenario");
  command->footer(R"(Examples:
  cutforce hash host_tests/recordings/entry_cut.csv.gz
  cutforce hash host_tests/scenarios/*.toml --streams /tmp

One hash is over the override bytes, one over every field of every output, both FNV-1a of 64 bits.
Equal numbers mean equal bits. toolchain/cortex_m/compare.sh holds the emulated boards against it.)");
  command->callback([options, &action] { action = [options] { return perform(*options); }; });
}

}  // namespace cutforce::firmware::host
