// The bare-metal images (preset cortex-m and its like) under QEMU: the host's bits, each fault by
// its name, and what the gates of their link refuse. Skipped, visibly, where the cross compiler,
// the emulator or the images are missing: toolchain/setup.sh cortex-m, then toolchain/test.sh.
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "support/run_command.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

namespace fs = std::filesystem;

const std::string kRoot = CUTFORCE_SOURCE_DIR;
const std::string kTools = kRoot + "/toolchain/cortex_m/";

struct Target {
  std::string preset;
  std::string machine;
};
const std::array<Target, 3> kTargets{
    {{"cortex-m", "mps2-an500"}, {"cortex-m4", "mps2-an386"}, {"cortex-m33", "mps2-an505"}}};

std::string image(const std::string& preset, const std::string& name) {
  return kRoot + "/build/" + preset + "/firmware/cortex_m/cutforce_" + name + ".elf";
}

// What is missing for these tests; empty: nothing.
std::string missing(const std::string& preset = "cortex-m") {
  for (const std::string command : {"arm-none-eabi-g++", "qemu-system-arm", "python3"}) {
    if (run_command("command -v " + command).exit_status != 0) return command + " is missing";
  }
  if (!fs::exists(image(preset, "image"))) return "build/" + preset + " has no image";
  return {};
}

CommandResult run_image(const Target& target, const std::string& name, const std::string& argument,
                        const std::string& options = {}) {
  return run_command("CUTFORCE_QEMU_OPTIONS=" + quoted(options) + " " + quoted(kTools + "run.sh") +
                     " " + target.machine + " " + quoted(image(target.preset, name)) + " " +
                     argument + " 2>&1");
}

TEST(CortexM, GivesTheBitsOfTheHost) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  const auto compared = run_command("CUTFORCE_PROGRAM=" + quoted(CUTFORCE_PROGRAM) + " " +
                                    quoted(kTools + "compare.sh") + " --quick 2>&1");
  EXPECT_NE(compared.output.find("m7 "), std::string::npos) << compared.output;
  if (compared.exit_status == 77) GTEST_SKIP() << compared.output;
  EXPECT_EQ(compared.exit_status, 0) << compared.output;
}

// The counts by kind are taken by another way than the meter's timer: they have to add up to it.
TEST(CortexM, FindsTheSameCountByKindAsByTimer) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  const auto mixed = run_command("CUTFORCE_PROGRAM=" + quoted(CUTFORCE_PROGRAM) + " python3 " +
                                 quoted(kTools + "mix.py") + " predictive 2>&1");
  ASSERT_EQ(mixed.exit_status, 0) << mixed.output;
  const auto budget = run_command("sed -n 's/^predictive //p' " +
                                  quoted(kRoot + "/host_tests/cortex_m/budget.txt"));
  const double by_kind = std::stod(mixed.output.substr(mixed.output.find(": ") + 2));
  // What the budget's own test allows a count to have grown by.
  EXPECT_NEAR(by_kind, std::stod(budget.output), 0.02 * by_kind) << mixed.output;
  for (const char* const kind : {"float + - x", "load", "store", "float comparison"})
    EXPECT_NE(mixed.output.find(kind), std::string::npos) << mixed.output;
}

TEST(CortexM, RefusesAStreamThatIsNotThereOrAnothers) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  const ScratchFolder folder;
  const auto gone = run_image(kTargets[0], "replay", quoted(folder.file("none").string()));
  EXPECT_EQ(gone.exit_status, 1) << gone.output;
  const auto other = folder.file("other");
  std::ofstream(other, std::ios::binary) << "cutforc1 but of another build, and not of this one";
  const auto refused = run_image(kTargets[0], "replay", quoted(other.string()));
  EXPECT_EQ(refused.exit_status, 1) << refused.output;
  EXPECT_NE(refused.output.find("another build has written it"), std::string::npos);
}

struct Break {
  std::string_view what;
  std::string_view handler;
  std::string_view words;
};
constexpr std::array<Break, 8> kBreaks{{
    {"overflow", "FAULT memory fault", "the stack has overflowed into its guard"},
    {"leap", "FAULT memory fault", "the stack has overflowed into its guard"},
    {"undefined", "FAULT usage fault", "undefined instruction"},
    {"division", "FAULT usage fault", "division by zero"},
    {"bus", "BFAR 0xb0000000", "bus error, of a load or store"},
    {"jump", "FAULT usage fault", "a jump to an address that is no Thumb code"},
    {"data", "FAULT memory fault", "instruction fetched from where none may be"},
    {"starve", "FAULT NMI (watchdog)", "  at 0x"},
}};

TEST(CortexM, NamesEveryFaultItBreaksInto) {
  constexpr int kFaultStatus = 99;
  for (const Target& target : kTargets) {
    if (const auto what = missing(target.preset); !what.empty()) GTEST_SKIP() << what;
    for (const Break& broken : kBreaks) {
      SCOPED_TRACE(target.preset + " " + std::string(broken.what));
      const auto result = run_image(target, "probe", std::string(broken.what));
      EXPECT_EQ(result.exit_status, kFaultStatus) << result.output;
      EXPECT_NE(result.output.find(broken.handler), std::string::npos) << result.output;
      EXPECT_NE(result.output.find(broken.words), std::string::npos) << result.output;
    }
    EXPECT_EQ(run_image(target, "probe", "feed").exit_status, 0);
    EXPECT_EQ(run_image(target, "probe", "nothing").exit_status, 0);
  }
}

// The board's image never ends; what it says on the UART is read after a while.
TEST(CortexM, RunsTheBoardsCycleAndMissesNothing) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  const ScratchFolder folder;
  const auto said = folder.file("uart.txt").string();
  const auto run =
      run_command("CUTFORCE_ICOUNT_SHIFT=3 CUTFORCE_QEMU_TIMEOUT_S=10 CUTFORCE_QEMU_OPTIONS=" +
                  quoted("-serial file:" + said) + " " + quoted(kTools + "run.sh") +
                  " mps2-an500 " + quoted(image("cortex-m", "image")) + " 2>&1");
  EXPECT_EQ(run.exit_status, 124) << run.output;  // stopped from outside
  const auto text = bytes_of(said);
  EXPECT_TRUE(text.starts_with("cutforce on mps2-an500\noverride 100 ")) << text;
  EXPECT_NE(text.find(" missed 0 "), std::string::npos) << text;
  EXPECT_EQ(text.find("FAULT"), std::string::npos) << text;
}

// The link's own options, on a source that defines planted().
CommandResult link(const std::string& name, const ScratchFolder& folder, bool gate) {
  const std::string wrapped =
      gate ? " $(sed '/^#/d; s/^/-Wl,--wrap=/' " + quoted(kTools + "unwanted.txt") + ")" : "";
  return run_command(
      "arm-none-eabi-g++ -std=c++23 -mcpu=cortex-m7 -mthumb -mfpu=fpv5-d16 -mfloat-abi=hard -O2 "
      "-fno-exceptions -fno-rtti -nostartfiles --specs=nano.specs" +
      std::string(gate ? "" : " --specs=nosys.specs -Wl,--defsym=end=0x20010000") + wrapped +
      " -Wl,--gc-sections -Wl,--no-warn-rwx-segments -Wl,--defsym=stack_size=1024 "
      "-Wl,-eplanted -L " +
      quoted(kRoot + "/hal/cortex_m") + " -T an500.ld " +
      quoted(kRoot + "/host_tests/cortex_m/planted/" + name + ".cpp") + " -o " +
      quoted(folder.file("planted.elf").string()) + " 2>&1");
}

TEST(CortexMLink, AcceptsWhatHasNothingInIt) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  const ScratchFolder folder;
  const auto linked = link("clean", folder, true);
  EXPECT_EQ(linked.exit_status, 0) << linked.output;
}

struct Violation {
  std::string name;
  std::string says;
};
const std::array<Violation, 8> kViolations{{
    {"malloc", "__wrap_malloc"},
    {"new", "__wrap__Znaj"},
    {"vector", "__wrap__Znwj"},
    {"throwing_helper", "__wrap__ZSt24__throw_out_of_range_fmtPKcz"},
    {"virtual_destructor", "__wrap__ZdlPv"},
    {"sbrk", "__wrap__sbrk"},
    {"print", "__wrap_printf"},
    {"constructor", "a global has a constructor that runs before"},
}};

TEST(CortexMLink, RefusesEachPlantedViolationByName) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  for (const Violation& violation : kViolations) {
    SCOPED_TRACE(violation.name);
    const ScratchFolder folder;
    const auto linked = link(violation.name, folder, true);
    EXPECT_NE(linked.exit_status, 0);
    EXPECT_NE(linked.output.find(violation.says), std::string::npos) << linked.output;
  }
}

CommandResult check_image(const std::string& file) {
  return run_command(quoted(kTools + "check_image.sh") + " arm-none-eabi-nm " + quoted(file) +
                     " 2>&1");
}

TEST(CortexMImageGate, AcceptsTheImages) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  for (const std::string name : {"image", "replay", "probe", "meter"}) {
    const auto checked = check_image(image("cortex-m", name));
    EXPECT_EQ(checked.exit_status, 0) << checked.output;
  }
}

TEST(CortexMImageGate, RefusesAHeapThatWasLinkedInAndAFileWithoutSymbols) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  const ScratchFolder folder;
  const auto linked = link("malloc", folder, false);
  ASSERT_EQ(linked.exit_status, 0) << linked.output;
  const std::string file = folder.file("planted.elf").string();
  const auto checked = check_image(file);
  EXPECT_EQ(checked.exit_status, 1);
  EXPECT_NE(checked.output.find("  malloc\n"), std::string::npos) << checked.output;
  EXPECT_NE(checked.output.find("  _sbrk\n"), std::string::npos) << checked.output;
  ASSERT_EQ(run_command("arm-none-eabi-strip " + quoted(file)).exit_status, 0);
  EXPECT_NE(check_image(file).exit_status, 0);
  EXPECT_NE(check_image("/nowhere/image.elf").exit_status, 0);
}

CommandResult stack_of(const std::string& name) {
  return run_command(quoted(kTools + "stack.py") + " " + quoted(kRoot + "/build/cortex-m") + " " +
                     quoted(image("cortex-m", name)) + " 2>&1");
}

long number_after(const std::string& text, const std::string& word) {
  const auto at = text.find(word + " ");
  return at == std::string::npos ? -1 : std::stol(text.substr(at + word.size() + 1));
}

TEST(CortexMStack, FitsAndHoldsMoreThanWasEverUsed) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  EXPECT_EQ(stack_of("image").exit_status, 0) << stack_of("image").output;
  const auto computed = stack_of("replay");
  ASSERT_EQ(computed.exit_status, 0) << computed.output;
  const ScratchFolder folder;
  const auto made = run_command(quoted(CUTFORCE_PROGRAM) + " hash " +
                                quoted(kRoot + "/host_tests/scenarios/demo_step.toml") +
                                " --streams " + quoted(folder.path().string()) + " 2>&1");
  ASSERT_EQ(made.exit_status, 0) << made.output;
  const auto painted =
      run_image(kTargets[0], "replay", quoted(folder.file("demo_step.stream").string()));
  ASSERT_EQ(painted.exit_status, 0) << painted.output;
  const long used = number_after(painted.output, "stack");
  const long worst = number_after(computed.output, "worst");
  EXPECT_GT(used, 1000);
  EXPECT_LE(used, worst);
  // The deepest path is a controller that joins in the middle of a jump, which no cut here has;
  // what was seen is more than half of it.
  EXPECT_GE(used, worst / 2) << computed.output << painted.output;
}

TEST(CortexMStack, IsNotKnownWhereSomethingCallsItself) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  const auto result = stack_of("probe");
  EXPECT_EQ(result.exit_status, 1);
  EXPECT_NE(result.output.find("recursion: "), std::string::npos) << result.output;
  EXPECT_NE(result.output.find("fall"), std::string::npos) << result.output;
}

const std::string kBudget = kRoot + "/host_tests/cortex_m/budget.txt";

CommandResult check_budget(const std::string& budget, const std::string& counts) {
  return run_command(quoted(kTools + "check_budget.py") + " " + quoted(budget) + " " +
                     quoted(counts) + " 2>&1");
}

TEST(CortexMBudget, HoldsWhatTheImageCosts) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  const ScratchFolder folder;
  const std::string counts = folder.file("counts.txt").string();
  const auto counted = run_command("CUTFORCE_PROGRAM=" + quoted(CUTFORCE_PROGRAM) + " " +
                                   quoted(kTools + "count.sh") + " 2>&1 > " + quoted(counts));
  ASSERT_EQ(counted.exit_status, 0) << counted.output;
  const auto checked = check_budget(kBudget, counts);
  EXPECT_EQ(checked.exit_status, 0) << checked.output;
}

TEST(CortexMBudget, RefusesWhatGrewBeyondItAndWhatNobodyCounts) {
  if (run_command("command -v python3").exit_status != 0) GTEST_SKIP() << "python3 is missing";
  const ScratchFolder folder;
  const auto write = [&](const char* name, const std::string& text) {
    std::ofstream(folder.file(name)) << text;
    return folder.file(name).string();
  };
  const auto budget = write("budget", "# agreed\nflash 1000\ntick 50  # a comment\n");
  const auto status = [&](const std::string& counts) {
    return check_budget(budget, write("counts", counts)).exit_status;
  };
  EXPECT_EQ(status("flash 1000\ntick 50\n"), 0);
  EXPECT_EQ(status("flash 1020\ntick 51\n"), 0);
  EXPECT_EQ(status("flash 1\ntick 1\n"), 0);
  EXPECT_EQ(status("flash 1021\ntick 50\n"), 1);
  EXPECT_EQ(status("flash 1000\ntick 52\n"), 1);
  EXPECT_EQ(status("flash 1000\n"), 1);
  EXPECT_EQ(status("flash 1000\ntick 50\nnew 1\n"), 1);
  EXPECT_EQ(status(""), 1);
}

TEST(CortexMBudget, IsCountedWithAMeterThatIsExact) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  const auto counted = run_command(quoted(kTools + "count.sh") + " 2>&1");
  EXPECT_NE(counted.output.find("\nempty 0\nnop_100 100\n"), std::string::npos) << counted.output;
  // No line for the most of any call: all of a thousand calls were counted alike.
  EXPECT_EQ(counted.output.find("nop_100_most"), std::string::npos) << counted.output;
}

}  // namespace
}  // namespace cutforce::host_tests
