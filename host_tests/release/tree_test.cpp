// What the tracked files look like, whatever they say.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "support/run_command.hpp"

namespace cutforce::host_tests {
namespace {

bool installed(const std::string& program) {
  return run_command("command -v " + program).exit_status == 0;
}

std::string in_tree(const std::string& command) {
  return "cd " + quoted(CUTFORCE_SOURCE_DIR) + " && " + command + " 2>&1";
}

// Empty where the tree is not a git checkout (a source archive).
std::vector<std::string> tracked_files() {
  std::vector<std::string> files;
  const auto listed = run_command(in_tree("git ls-files --cached --others --exclude-standard"));
  if (listed.exit_status != 0) return files;
  std::istringstream lines(listed.output);
  for (std::string line; std::getline(lines, line);) files.push_back(line);
  return files;
}

// The paths of those that end so, quoted, for a command line.
std::string ending(const std::vector<std::string>& files, std::initializer_list<const char*> ends) {
  std::string result;
  for (const auto& file : files)
    for (const char* end : ends)
      if (file.ends_with(end)) result += " " + quoted(file);
  return result;
}

TEST(Tree, IsFormatted) {
  const auto files = tracked_files();
  if (files.empty()) GTEST_SKIP() << "not a git checkout";
  if (!installed("clang-format")) GTEST_SKIP() << "clang-format is not installed";
  const auto result =
      run_command(in_tree("clang-format --dry-run --Werror" + ending(files, {".cpp", ".hpp"})));
  EXPECT_EQ(result.exit_status, 0) << result.output << "\nmend it with clang-format -i";
}

TEST(Tree, HasShellScriptsThatShellcheckAccepts) {
  const auto files = tracked_files();
  if (files.empty()) GTEST_SKIP() << "not a git checkout";
  if (!installed("shellcheck")) GTEST_SKIP() << "shellcheck is not installed";
  const auto result =
      run_command(in_tree("shellcheck --external-sources" + ending(files, {".sh", ".ci/run"})));
  EXPECT_EQ(result.exit_status, 0) << result.output;
}

// A path that exists on one machine only, or the name of the host that a package came from: they
// slip in with lock files, logs and generated files. Each pattern is kept in two pieces, so that
// this file does not match itself.
std::vector<std::string> machine_traces(const std::string& text) {
  static const std::vector<std::regex> patterns = [] {
    struct Pieces {
      const char* front;
      const char* back;
    };
    constexpr Pieces kPieces[] = {
        {R"((^|[\s"'`=(:,])/)", R"((work|home|root|Users|mnt|workspace)/[A-Za-z0-9_.])"},
        {R"((^|[\s"'`=(:,])/)", R"(tmp/(wt|clone)[-/])"},
        {R"([A-Z]:\\)", R"(Users\\)"},
        {R"((deb|security|ftp|snapshot)\.)", R"(debian\.org)"},
        {R"((registry|npm)\.)", R"((npmjs|yarnpkg)\.(org|com))"},
        {R"((pypi|pythonhosted)\.)", R"(org)"},
        {R"((proxy|sum)\.)", R"(golang\.org)"},
        {R"((static|index)\.)", R"(crates\.io)"},
        {R"((artifactory|nexus|devpi))", R"([-./:][a-z0-9])"},
        {R"(https?://[a-z0-9.-]+\.)", R"((internal|local|lan|corp)\b)"},
    };
    std::vector<std::regex> compiled;
    for (const auto& [front, back] : kPieces)
      compiled.emplace_back(std::string(front) + back, std::regex::optimize);
    return compiled;
  }();
  std::vector<std::string> found;
  std::istringstream lines(text);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    // A longer line is a packed library or data, and std::regex recurses once a character.
    if (line.size() > 2000) continue;
    for (const auto& pattern : patterns) {
      std::smatch match;
      if (std::regex_search(line, match, pattern))
        found.push_back(std::to_string(number) + ": " + match.str());
    }
  }
  return found;
}

TEST(Tree, NamesNoMachineAndNoPackageHost) {
  const auto files = tracked_files();
  if (files.empty()) GTEST_SKIP() << "not a git checkout";
  for (const auto& name : files) {
    std::ifstream file(std::filesystem::path(CUTFORCE_SOURCE_DIR) / name, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    if (text.find('\0') != std::string::npos) continue;  // compressed recordings, pictures
    for (const auto& trace : machine_traces(text)) ADD_FAILURE() << name << ":" << trace;
  }
}

TEST(Tree, IsSearchedForTracesThatAreFound) {
  for (const std::string planted : {
           "see /ho"
           "me/someone/cutforce/build",
           "path=\"/wo"
           "rk/main/out\"",
           "/ro"
           "ot/.cache",
           "deb http://deb.de"
           "bian.org/debian bookworm main",
           "\"resolved\": \"https://registry.np"
           "mjs.org/uplot/-/uplot-1.6.31.tgz\"",
           "https://py"
           "pi.org/simple",
           "index-url = http://artif"
           "actory.example.com/simple",
           "http://mirror.example.inter"
           "nal/debian",
       }) {
    EXPECT_FALSE(machine_traces(planted).empty()) << planted;
  }
  for (const std::string harmless :
       {"#!/usr/bin/env bash", "/usr/share/eigen3", "host_tests/release/tree_test.cpp",
        "https://github.com/leeoniya/uPlot", "#include <sys/wait.h>", "and/or/root/cause"}) {
    EXPECT_TRUE(machine_traces(harmless).empty()) << harmless;
  }
}

TEST(Tree, HasScriptsThatCanBeRun) {
  std::string loop = "for file in .ci/run";
  for (const char* name : {"setup", "run", "test", "count_instructions", "check_core_symbols"})
    loop += std::string(" toolchain/") + name + ".sh";
  const auto result = run_command(in_tree(loop + "; do test -x $file || echo $file; done"));
  EXPECT_EQ(result.output, "");
}

}  // namespace
}  // namespace cutforce::host_tests
