// What the stand-in for libgpiod 2.x holds, for the test to look at and to spoil. Chip and lines
// exist once; levels are logical, as the library's are.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <string>
#include <utility>
#include <vector>

namespace cutforce::host_tests {

struct StandIn {
  static constexpr unsigned kLines = 16;

  std::array<int, kLines> level{};
  std::array<bool, kLines> requested{};
  std::array<bool, kLines> output{};
  std::array<bool, kLines> active_low{};
  std::array<int, kLines> edges{};  // gpiod_line_edge of the request
  std::string consumer;
  int busy_line = -1;     // held by somebody else
  bool no_edges = false;  // the chip has no interrupts
  struct Edge {
    unsigned offset;
    bool rising;
    std::uint64_t time_ns;
  };
  std::deque<Edge> queue;  // not fetched yet
  bool refuse = false;
  std::vector<std::pair<unsigned, int>> changes;  // after the request: line, level
  int alive_objects = 0;                          // given out and not yet freed
};

extern StandIn stand_in;

}  // namespace cutforce::host_tests
