#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "firmware/host/commands/command.hpp"
#include "firmware/host/commands/progress.hpp"
#include "firmware/host/compare/comparison.hpp"
#include "firmware/host/compare/comparison_page.hpp"
#include "firmware/host/compare/comparison_text.hpp"
#include "firmware/host/compare/goals.hpp"
#include "firmware/host/run/output_folder.hpp"
#include "firmware/host/write_file.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::InputError;

constexpr std::string_view kSubject = "predictive";
constexpr std::uint32_t kMostSeeds = 1000;

struct Options {
  std::vector<std::string> controllers;
  std::vector<std::string> parts;
  std::string surroundings = "noise";
  std::uint32_t seeds = 8;
  unsigned threads = 0;
  std::string folder;
  std::string json_file;
  bool quick = false;
  bool json = false;
};

InputError unknown(const char* option, const std::string& name, const std::string& known) {
  return {option, "there is none named " + name, "give one of " + known};
}

template <class Range, class Name>
std::string list_of(const Range& range, Name name) {
  std::string text;
  for (const auto& one : range) text += (text.empty() ? "" : ", ") + std::string(name(one));
  return text;
}

std::string contender_names() {
  return list_of(contenders(), [](const Contender& c) { return c.name; });
}

std::string part_names() {
  return list_of(comparison_parts(), [](const Part& p) { return p.name; });
}

// As the comparison's own order has them, each once.
std::expected<std::vector<const Contender*>, InputError> chosen_contenders(
    const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    if (find_contender(name) == nullptr) {
      return std::unexpected{unknown("--controller", name, contender_names())};
    }
  }
  std::vector<const Contender*> chosen;
  for (const Contender& contender : contenders()) {
    if (names.empty() || std::ranges::find(names, contender.name) != names.end()) {
      chosen.push_back(&contender);
    }
  }
  return chosen;
}

std::expected<std::vector<Part>, InputError> chosen_parts(const std::vector<std::string>& names) {
  std::vector<Part> parts = comparison_parts();
  for (const std::string& name : names) {
    if (std::ranges::find(parts, name, &Part::name) == parts.end()) {
      return std::unexpected{unknown("--part", name, part_names())};
    }
  }
  std::erase_if(parts, [&names](const Part& part) {
    return !names.empty() && std::ranges::find(names, part.name) == names.end();
  });
  return parts;
}

std::expected<ComparisonOptions, InputError> choose(const Options& options) {
  ComparisonOptions chosen{.contenders = {}, .parts = {}};
  auto contenders = chosen_contenders(options.controllers);
  if (!contenders) return std::unexpected{contenders.error()};
  auto parts = chosen_parts(options.parts);
  if (!parts) return std::unexpected{parts.error()};
  chosen.contenders = std::move(*contenders);
  chosen.parts = std::move(*parts);
  bool known = false;
  for (const auto s : {Surroundings::kExact, Surroundings::kNoise, Surroundings::kRandom}) {
    if (options.surroundings != name_of(s)) continue;
    chosen.surroundings = s;
    known = true;
  }
  if (!known) {
    return std::unexpected{unknown("--surroundings", options.surroundings, "exact, noise, random")};
  }
  if (options.seeds < 1 || options.seeds > kMostSeeds) {
    return std::unexpected{InputError{"--seeds", "is " + std::to_string(options.seeds),
                                      "give a number from 1 to " + std::to_string(kMostSeeds)}};
  }
  // Without noise a seed still draws the phase of the PLC's scan.
  chosen.seeds = options.quick ? 1 : options.seeds;
  chosen.robustness = !options.quick;
  chosen.traces = !options.folder.empty();
  const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
  chosen.threads = options.threads > 0 ? options.threads : cores;
  return chosen;
}

// Their own cuts are worth it only beside the whole comparison.
std::vector<Goal> all_goals(const Comparison& comparison, const Options& options,
                            unsigned threads) {
  const ComparisonRow* subject = comparison.find(kSubject);
  const bool whole = comparison.parts.size() == comparison_parts().size();
  if (subject == nullptr || !whole) return {};
  std::vector<Goal> goals = goals_of(comparison, kSubject);
  if (options.quick || comparison.surroundings != Surroundings::kNoise) return goals;
  Progress progress("goals", "cuts");
  for (Goal& goal :
       further_goals(*subject->contender, threads, [&progress](std::size_t done, std::size_t) {
         progress.show(static_cast<double>(done));
       })) {
    goals.push_back(std::move(goal));
  }
  std::ranges::stable_sort(goals, {}, &Goal::number);
  return goals;
}

std::expected<void, InputError> write_results(const Options& options, const Comparison& comparison,
                                              const std::vector<Goal>& goals) {
  const std::string json = comparison_json(comparison, goals).dump(1) + "\n";
  if (!options.json_file.empty()) {
    if (auto written = write_file(options.json_file, json); !written) return written;
  }
  if (options.folder.empty()) return {};
  const std::filesystem::path path = options.folder;
  for (const auto& [name, text] :
       {std::pair{"comparison.json", json},
        std::pair{"comparison.html", comparison_page(comparison, goals)}}) {
    if (auto written = write_file(path / name, text); !written) return written;
  }
  return {};
}

Exit perform(const Options& options) {
  catch_stop_signals();
  const auto chosen = choose(options);
  if (!chosen) return refuse(chosen.error());
  auto folder = OutputFolder::make(options.folder);
  if (!folder) return refuse(folder.error());
  Comparison comparison;
  {
    Progress progress("compare", "pieces of work");
    comparison = compare(*chosen, [&progress](std::size_t done, std::size_t total) {
      progress.show(static_cast<double>(done), "of " + std::to_string(total));
    });
  }
  const std::vector<Goal> goals = all_goals(comparison, options, chosen->threads);
  if (const auto written = write_results(options, comparison, goals); !written) {
    show_error(written.error());
    return Exit::kFailed;
  }
  folder->keep();
  if (options.json) {
    std::cout << comparison_json(comparison, goals).dump(1) << "\n";
    return Exit::kDone;
  }
  std::cout << comparison_table(comparison, goals) << comparison.cuts << " cuts in "
            << fixed(comparison.elapsed_s, 1) << " s, "
            << fixed(static_cast<double>(comparison.cuts) / comparison.elapsed_s, 0)
            << " a second\n";
  if (!options.folder.empty()) {
    std::cout << (std::filesystem::path(options.folder) / "comparison.html").string() << "\n";
  }
  return Exit::kDone;
}

}  // namespace

void add_compare(CLI::App& program, Action& action) {
  auto* command = program.add_subcommand(
      "compare",
      "Every controller on parts with one difficulty each, beside what could be reached");
  auto options = std::make_shared<Options>();
  command->add_option("--controller", options->controllers, "Only these: " + contender_names())
      ->type_name("NAME");
  command->add_option("--part", options->parts, "Only these: " + part_names())->type_name("NAME");
  command
      ->add_option("--surroundings", options->surroundings,
                   "exact; noise: 2 % and a gain error; random: every lag and material drawn too")
      ->type_name("NAME")
      ->capture_default_str();
  command->add_option("--seeds", options->seeds, "Each part is cut this often")
      ->type_name("N")
      ->capture_default_str();
  command->add_option("--threads", options->threads, "At once; as many as there are cores")
      ->type_name("N");
  command->add_flag("--quick", options->quick,
                    "One seed, without the search for the limits of stability");
  command->add_option("--out", options->folder, "Write comparison.json and comparison.html there")
      ->type_name("DIR");
  command->add_option("--json-file", options->json_file, "Also write the figures to a file")
      ->type_name("FILE");
  command->add_flag("--json", options->json, "Print the figures as JSON");
  command->footer(R"(Examples:
  cutforce compare --quick
  cutforce compare --out out/compare
  cutforce compare --controller pi_tuned oracle_detected --part step4 entry3 --seeds 20)");
  command->callback([options, &action] { action = [options] { return perform(*options); }; });
}

}  // namespace cutforce::firmware::host
