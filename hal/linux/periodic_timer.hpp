// A tick at start + k * period, absolute, on CLOCK_MONOTONIC. A tick that comes too late is not
// made up for: whole periods that have passed meanwhile are returned as missed and skipped, and
// the phase stays. FAULTS 9.
#pragma once

#include <algorithm>
#include <cstdint>
#include <expected>

#include "hal/linux/monotonic_clock.hpp"
#include "hal/linux/open_error.hpp"

namespace cutforce::hal::os {

// When the next tick is, and how many were skipped. Pure.
class TickSchedule {
 public:
  struct Tick {
    std::int64_t due_ns;
    std::uint32_t missed;
  };

  constexpr TickSchedule(std::int64_t start_ns, std::int64_t period_ns) noexcept
      : last_ns_(start_ns), period_ns_(period_ns) {}

  // The first tick after the last that is not wholly past: due_ns + period > now.
  constexpr Tick next(std::int64_t now_ns) noexcept {
    last_ns_ += period_ns_;
    const auto late = std::max<std::int64_t>(0, (now_ns - last_ns_) / period_ns_);
    last_ns_ += late * period_ns_;
    return {.due_ns = last_ns_,
            .missed = static_cast<std::uint32_t>(std::min<std::int64_t>(late, UINT32_MAX))};
  }

 private:
  std::int64_t last_ns_;
  std::int64_t period_ns_;
};

class PeriodicTimer {
 public:
  // The first tick is one period from now. Fails iff the period is not 1 us..10 s.
  [[nodiscard]] static std::expected<PeriodicTimer, OpenError> start(std::int64_t period_ns);

  struct Wake {
    std::int64_t due_ns;   // the moment that was asked for
    std::int64_t late_ns;  // how long after it the thread ran
    std::uint32_t missed;  // periods that were skipped before it
  };
  // Sleeps to the next tick. A signal does not wake it: the longest delay of a stop is a period.
  [[nodiscard]] Wake wait() noexcept;

 private:
  explicit PeriodicTimer(std::int64_t period_ns) noexcept : schedule_(monotonic_ns(), period_ns) {}

  TickSchedule schedule_;
};

}  // namespace cutforce::hal::os
