// The thread that must not wait: one tick of the board after the other, by an absolute clock. It
// starts no tick twice to catch up, allocates nothing, and touches no file. What it needs of the
// system (priority, locked memory) it asks for at its start, and goes on without where that is
// refused: the words about it are for a person.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "firmware/board.hpp"
#include "firmware/linux/ports.hpp"
#include "firmware/linux/shared.hpp"
#include "hal/linux/real_time.hpp"

namespace cutforce::firmware::board {

class ControlThread {
 public:
  struct Settings {
    std::int64_t tick_ns;
    std::int32_t priority;
    std::uint64_t ticks;  // then it ends by itself; 0: never
  };

  // Starts at once. All three outlive it.
  ControlThread(Board& board, Ports& ports, Shared& shared, Settings settings);
  ControlThread(const ControlThread&) = delete;
  ControlThread& operator=(const ControlThread&) = delete;
  ~ControlThread();

  // Asks for the end, and waits for it: the board says on the bus that it stops, and the override
  // stays where the supervisor leaves it.
  void stop();

  // After the first tick: what the system refused, one sentence each.
  [[nodiscard]] std::vector<std::string> warnings() const;

 private:
  void run();
  [[nodiscard]] std::optional<hal::os::WakeupLatency> prepare();

  Board& board_;
  Ports& ports_;
  Shared& shared_;
  Settings settings_;
  std::vector<std::string> warnings_;
  std::atomic<bool> warned_{false};
  std::thread thread_;
};

}  // namespace cutforce::firmware::board
