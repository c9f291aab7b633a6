// The processor in the loop: the board's image on an emulated Cortex-M7, its bus the UART, and on
// the other end the bench's lathe and CNC. What the board answers is what the board of this process
// answers, frame by frame, and so is the override that the CNC runs. Skipped, visibly, where the
// cross compiler, the emulator or the image are missing.
//
//   cmake --build --preset cortex-m && cmake --build --preset host-release
//   build/release/host_tests/release/cutforce_release_tests --gtest_filter='ProcessorInLoop.*'
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "support/bench_board.hpp"
#include "support/lockstep_board.hpp"
#include "support/run_command.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

namespace fs = std::filesystem;

const std::string kRoot = CUTFORCE_SOURCE_DIR;
const std::string kImage = kRoot + "/build/cortex-m/firmware/cortex_m/cutforce_lockstep.elf";

std::string missing() {
  for (const std::string command : {"arm-none-eabi-g++", "qemu-system-arm"}) {
    if (run_command("command -v " + command).exit_status != 0) return command + " is missing";
  }
  return fs::exists(kImage) ? std::string{} : kImage + " is missing";
}

// QEMU with the image, its UART on the socket.
class Emulated {
 public:
  explicit Emulated(const std::string& socket)
      : pipe_(popen(
            ("CUTFORCE_QEMU_TIMEOUT_S=180 CUTFORCE_QEMU_OPTIONS='-chardev "
             "socket,id=uart,path=" +
             socket + " -serial chardev:uart' " + quoted(kRoot + "/toolchain/cortex_m/run.sh") +
             " mps2-an500 " + quoted(kImage) + " 2>&1")
                .c_str(),
            "r")) {}
  Emulated(const Emulated&) = delete;
  Emulated& operator=(const Emulated&) = delete;
  ~Emulated() {
    if (pipe_ != nullptr) pclose(pipe_);
  }

  [[nodiscard]] int status() {
    const int status = pclose(pipe_);
    pipe_ = nullptr;
    return status;
  }

 private:
  std::FILE* pipe_;
};

struct Ran {
  std::vector<std::uint8_t> overrides;  // in effect, each sample
  std::vector<hal::can::Frame> frames;  // of the board
  float most_n = 0.0F;                  // cutting force
};

template <class Device>
Ran run(const firmware::host::Scenario& scenario, Device& board, double duration_s) {
  auto bench = bench_with(scenario, bench_config());
  Ran ran;
  BenchBeside<Device> together{.bench = bench, .board = board};
  together.to_bench = [&ran](const hal::can::Frame& frame, std::int64_t) {
    ran.frames.push_back(frame);
    return true;
  };
  while (bench.now_ns() < static_cast<std::int64_t>(duration_s * 1e9)) {
    together.step();
    ran.overrides.push_back(bench.row().cnc.override_pct);
    ran.most_n = std::max(ran.most_n, static_cast<float>(bench.row().truth.cutting_force_n));
  }
  return ran;
}

constexpr double kDuration_s = 7.0;  // in the cut since 3.4; all 13 give no less

TEST(ProcessorInLoop, GivesTheFramesAndTheOverrideOfTheHostIntoTheCut) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  const auto scenario = committed_scenario("bench_lathe");
  auto board = board_of(scenario);
  const Ran wanted = run(scenario, board, kDuration_s);

  const ScratchFolder folder;
  const auto path = folder.file("uart");
  LockstepSocket socket(path);
  Emulated emulated(path.string());
  socket.accept();
  const auto scale = firmware::host::full_scale_of(scenario);
  LockstepBoard guest(socket, machine_of(scenario), 1, scale.voltage_v, scale.current_a);
  const Ran got = run(scenario, guest, kDuration_s);
  guest.end();

  EXPECT_EQ(emulated.status(), 0);
  EXPECT_EQ(got.overrides, wanted.overrides);
  EXPECT_EQ(got.frames, wanted.frames);
  // It is no run of a board that only says 100.
  EXPECT_GT(wanted.most_n, 300.0F);
  EXPECT_LT(*std::ranges::min_element(wanted.overrides), 90);
}

TEST(ProcessorInLoop, RefusesAMachineThatMakesNoLoop) {
  if (const auto what = missing(); !what.empty()) GTEST_SKIP() << what;
  const ScratchFolder folder;
  LockstepSocket socket(folder.file("uart"));
  Emulated emulated(folder.file("uart").string());
  socket.accept();
  auto machine = machine_of(committed_scenario("bench_lathe"));
  machine.pole_pairs = 0.0F;
  EXPECT_THROW(LockstepBoard(socket, machine, 1, 400.0F, 100.0F), std::runtime_error);
  EXPECT_NE(emulated.status(), 0);
}

}  // namespace
}  // namespace cutforce::host_tests
