#include "include_layers.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

namespace cutforce::host_tests {
namespace {

namespace fs = std::filesystem;

TEST(IncludeLayers, HoldInEveryFileOfTheHouse) {
  const fs::path root = CUTFORCE_SOURCE_DIR;
  int files = 0;
  for (const char* folder : {"estimator", "control", "hal", "firmware"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      const auto extension = entry.path().extension();
      if (extension != ".hpp" && extension != ".cpp") continue;
      ++files;
      std::ifstream file(entry.path());
      const std::string text{std::istreambuf_iterator<char>(file), {}};
      for (const auto& violation : check_includes(fs::relative(entry.path(), root).string(), text))
        ADD_FAILURE() << violation.where << ": " << violation.header << ": " << violation.rule;
    }
  }
  EXPECT_GE(files, 5) << "the folders were not found";
}

struct Case {
  const char* path;
  const char* include;
};

TEST(IncludeLayers, RefuseEveryPlantedViolation) {
  constexpr Case kPlanted[] = {
      {"estimator/a.hpp", "#include <iostream>"},
      {"estimator/a.hpp", "#include <string>"},
      {"estimator/a.cpp", "#include <vector>"},
      {"control/a.hpp", "#include <memory>"},
      {"control/a.hpp", "#include <functional>"},
      {"control/a.hpp", "#include <map>"},
      {"control/a.hpp", "#include <thread>"},
      {"control/a.hpp", "#include <mutex>"},
      {"firmware/control_loop.hpp", "#include <chrono>"},
      {"firmware/control_loop.hpp", "#include <unordered_map>"},
      {"estimator/a.hpp", "  #  include\t<cstdlib>"},
      {"estimator/a.hpp", "#include <Eigen/Core>"},
      {"firmware/control_loop.cpp", "#include <Eigen/Core>"},
      {"hal/linux/gpio.cpp", "#include <Eigen/Core>"},
      {"estimator/a.hpp", "#include \"control/pi.hpp\""},
      {"control/a.hpp", "#include \"estimator/fault.hpp\""},
      {"estimator/a.hpp", "#include \"hal/port.hpp\""},
      {"estimator/identification/a.cpp", "#include \"firmware/machine.hpp\""},
      {"hal/port.hpp", "#include \"estimator/fault.hpp\""},
      {"hal/port.hpp", "#include <string>"},
      {"hal/port.hpp", "#include \"hal/host/replay.hpp\""},
      {"hal/host/replay.hpp", "#include \"firmware/machine.hpp\""},
      {"hal/host/replay.hpp", "#include \"hal/linux/gpio.hpp\""},
      {"hal/host/replay.cpp", "#include <sys/mman.h>"},
      {"hal/linux/gpio.hpp", "#include <linux/gpio.h>"},
      {"firmware/control_loop.hpp", "#include \"hal/host/replay.hpp\""},
      {"firmware/control_loop.hpp", "#include \"firmware/host/summary.hpp\""},
      {"firmware/control_loop.hpp", "#include <nlohmann/json.hpp>"},
      {"firmware/host/main.cpp", "#include \"hal/linux/gpio.hpp\""},
      {"firmware/host/main.cpp", "#include <linux/can.h>"},
      {"firmware/host/write_file.hpp", "#include <unistd.h>"},
      {"firmware/linux/main.cpp", "#include \"hal/cortex_m/registers.hpp\""},
      {"firmware/linux/main.cpp", "#include <linux/can.h>"},
      {"firmware/host/main.cpp", "#include \"firmware/linux/service.hpp\""},
      {"firmware/host/main.cpp", "#include \"hal/unheard_of.hpp\""},
      {"firmware/cortex_m/main.cpp", "#include \"firmware/host/summary.hpp\""},
      {"firmware/cortex_m/main.cpp", "#include \"hal/host/replay.hpp\""},
      {"firmware/board.hpp", "#include \"hal/linux/can_socket.hpp\""},
      {"hal/can_port.hpp", "#include \"hal/can/messages.hpp\""},
      {"hal/can/guard.cpp", "#include <vector>"},
      {"hal/can/guard.cpp", "#include <linux/can.h>"},
      {"hal/can/guard.cpp", "#include <Eigen/Core>"},
      {"hal/can/messages.hpp", "#include \"control/supervisor.hpp\""},
      {"hal/can/messages.hpp", "#include \"firmware/loop_output.hpp\""},
      {"hal/can/messages.hpp", "#include \"hal/linux/can_socket.hpp\""},
      {"hal/can/messages.hpp", "#include \"hal/host/replay.hpp\""},
      {"hal/linux/can_socket.hpp", "#include <linux/can.h>"},
      {"hal/linux/can_socket.cpp", "#include \"hal/host/replay.hpp\""},
      {"control/supervisor.hpp", "#include \"hal/can/messages.hpp\""},
      {"firmware/host/main.cpp", "#include \"host_tests/support/allocation_count.hpp\""},
      {"estimator/a.cpp", "#include \"fault.hpp\""},
      {"estimator/a.cpp", "#include \"estimator/../control/pi.hpp\""},
      {"estimator/a.cpp", "#include HEADER_NAMED_BY_A_MACRO"},
  };
  for (const auto& [path, include] : kPlanted) {
    const auto violations = check_includes(path, std::string("\n") + include + "\n");
    EXPECT_EQ(violations.size(), 1U) << path << ": " << include;
    if (violations.size() == 1) {
      EXPECT_EQ(violations[0].where, std::string(path) + ":2");
    }
  }
}

TEST(IncludeLayers, AcceptWhatTheTableAllows) {
  constexpr Case kAllowed[] = {
      {"estimator/a.hpp", "#include <expected>"},
      {"estimator/a.cpp", "#include <Eigen/Dense>"},
      {"estimator/identification/a.cpp", "#include \"estimator/fault.hpp\""},
      {"hal/host/replay.cpp", "#include <vector>"},
      {"hal/host/replay.cpp", "#include <zlib.h>"},
      {"hal/host/replay.hpp", "#include \"hal/port.hpp\""},
      {"hal/linux/gpio.cpp", "#include <linux/gpio.h>"},
      {"firmware/control_loop.hpp", "#include \"hal/port.hpp\""},
      {"firmware/control_loop.hpp", "#include \"estimator/fault.hpp\""},
      {"firmware/host/main.cpp", "#include \"firmware/machine.hpp\""},
      {"firmware/host/main.cpp", "#include \"hal/host/replay.hpp\""},
      {"firmware/host/main.cpp", "#include <CLI/CLI.hpp>"},
      {"firmware/host/write_file.cpp", "#include <unistd.h>"},
      {"firmware/linux/main.cpp", "#include \"hal/linux/gpio.hpp\""},
      {"firmware/linux/main.cpp", "#include \"hal/host/recording_writer.hpp\""},
      {"firmware/linux/main.cpp", "#include \"firmware/host/machine_file.hpp\""},
      {"firmware/board.hpp", "#include \"hal/can_port.hpp\""},
      {"firmware/board.hpp", "#include \"hal/byte_port.hpp\""},
      {"firmware/board.hpp", "#include \"hal/sample_source.hpp\""},
      {"firmware/board.hpp", "#include \"hal/can/messages.hpp\""},
      {"firmware/cortex_m/main.cpp", "#include \"hal/can/messages.hpp\""},
      {"hal/can_port.hpp", "#include \"hal/can/frame.hpp\""},
      {"hal/can/sample_assembler.hpp", "#include \"hal/port.hpp\""},
      {"hal/linux/can_socket.cpp", "#include <linux/can.h>"},
      {"hal/linux/can_socket.hpp", "#include \"hal/can/frame.hpp\""},
      {"hal/host/can_log.hpp", "#include \"hal/can_port.hpp\""},
      {"host_tests/a_test.cpp", "#include <sys/wait.h>"},
      {"estimator/a.hpp", "// #include <string> is what a host program would do"},
  };
  for (const auto& [path, include] : kAllowed) {
    const auto violations = check_includes(path, include);
    EXPECT_TRUE(violations.empty()) << path << ": " << include << ": " << violations[0].rule;
  }
}

}  // namespace
}  // namespace cutforce::host_tests
