// Everything of the service that may wait: traces, the words for the journal, watchdogs, and
// bringing back a bus that went off. It runs in the main thread until somebody stops it.
//
// The watchdogs are fed only while tick, bus and sampling have all gone on since the last time. A
// bus without another node, or an acquisition node that is silent, is served all the same: that is
// the supervisor's affair, and a reset would not cure it.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "firmware/linux/ports.hpp"
#include "firmware/linux/shared.hpp"
#include "firmware/linux/trace_folder.hpp"
#include "hal/linux/restart_delay.hpp"
#include "hal/linux/service_notifier.hpp"
#include "hal/linux/watchdog.hpp"

namespace cutforce::firmware::board {

class Housekeeping {
 public:
  using Say = std::function<void(const std::string&)>;

  Housekeeping(Shared& shared, Ports& ports, TraceFolder& traces,
               std::optional<hal::os::Watchdog> watchdog, hal::os::ServiceNotifier notifier,
               Say say);

  // Once; to be called some ten times a second.
  void run(std::int64_t now_ns);
  // The last rows, and the watchdog's orderly end.
  void finish();

 private:
  struct Progress {
    std::uint64_t ticks;
    std::uint64_t bus;
    std::uint64_t samples;
  };

  void drain();
  void feed();
  void restart_bus(std::int64_t now_ns);
  void tell(const StateChange& change);

  Shared& shared_;
  Ports& ports_;
  TraceFolder& traces_;
  std::optional<hal::os::Watchdog> watchdog_;
  hal::os::ServiceNotifier notifier_;
  Say say_;
  hal::os::RestartDelay delay_;
  Progress fed_{};
  bool ready_ = false;
  bool complained_ = false;  // of a restart that failed
  bool starving_ = false;
  bool watchdog_refused_ = false;
};

}  // namespace cutforce::firmware::board
