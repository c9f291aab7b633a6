// The bench at the pace of a clock, over links: a sample each sample period, live on a terminal,
// until its time is over or a person ends it.
#pragma once

#include <cstdint>
#include <expected>
#include <filesystem>
#include <string>
#include <vector>

#include "firmware/host/bench/bench.hpp"
#include "firmware/host/bench/bench_log.hpp"
#include "firmware/host/bench/bench_ports.hpp"

namespace cutforce::firmware::host {

struct BenchRun {
  double duration_s;            // of sample time; 0: until somebody ends it
  double wait_s;                // for the board
  bool paced;                   // false: as fast as it goes, for a board that is a call
  bool abrupt;                  // stops in the midst, as if a cable were pulled
  std::filesystem::path trace;  // empty: none
};

struct BenchResult {
  std::vector<Figure> figures;
  std::vector<Event> events;
  std::string verdict;
  bool held;  // BenchLog::held()
};

// In the end, unless it is abrupt, some more frames say that arm and control are low; they are not
// part of the result. Either link may be null. Fails iff the trace cannot be written or the system
// refuses a link.
[[nodiscard]] std::expected<BenchResult, hal::host::InputError> run_bench(Bench& bench,
                                                                          CanLink* can,
                                                                          LineLink* lines,
                                                                          const BenchRun& run);

}  // namespace cutforce::firmware::host
