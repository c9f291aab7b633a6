// The service: files checked, ports opened, the board made, two threads, and an orderly end.
//
// Exit status: 0 it was told to end, 2 the files or the wiring are wrong;
// nothing was armed then, and no line was touched unless every port could be opened.
#pragma once

#include <cstdint>
#include <filesystem>

namespace cutforce::firmware::board {

struct ServiceOptions {
  std::filesystem::path board;
  bool check_only;      // files alone: opens no port
  std::uint64_t ticks;  // ends after so many; 0: when it is told to
};

[[nodiscard]] int run_service(const ServiceOptions& options);

}  // namespace cutforce::firmware::board
