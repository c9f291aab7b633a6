// What the control thread and the housekeeping thread share: two rings and some counters, each
// written by one of them. Nobody waits for anybody.
#pragma once

#include <atomic>
#include <cstdint>

#include "control/supervisor.hpp"
#include "firmware/linux/ring.hpp"
#include "firmware/loop_output.hpp"

namespace cutforce::firmware::board {

struct StateChange {
  std::int64_t time_ns;  // by the board's clock
  control::SupervisorState state;
  control::Reason reason;
  std::uint8_t override_pct;
};

struct Shared {
  // Eight seconds of estimates: longer than a flash card blocks.
  Ring<LoopOutput, 8192> rows;
  Ring<StateChange, 256> changes;

  // By the control thread.
  std::atomic<std::uint64_t> ticks{0};
  std::atomic<std::uint64_t> bus_passes{0};     // the bus was served without a refusal
  std::atomic<std::uint64_t> sample_passes{0};  // so was the source
  std::atomic<std::uint64_t> missed_ticks{0};
  std::atomic<std::uint32_t> worst_loop_us{0};
  std::atomic<bool> bus_failed{false};  // off, down, or without an answer
  // From the first tick in kMonitor or above to the last tick.
  std::atomic<std::uint64_t> armed_ticks{0};
  std::atomic<std::uint64_t> armed_missed{0};
  std::atomic<std::uint64_t> armed_page_faults{0};
  std::atomic<std::uint64_t> armed_allocations{0};
  std::atomic<bool> finished{false};

  // By the housekeeping thread.
  std::atomic<bool> stop{false};
  std::atomic<std::uint32_t> restarts{0};  // of the bus
};

}  // namespace cutforce::firmware::board
