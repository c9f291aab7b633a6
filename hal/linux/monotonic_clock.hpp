// CLOCK_MONOTONIC in nanoseconds, and waiting by it.
#pragma once

#include <cstdint>

namespace cutforce::hal::os {

[[nodiscard]] std::int64_t monotonic_ns() noexcept;

// Sleeps to the moment; a signal does not shorten it.
void sleep_until(std::int64_t time_ns) noexcept;

// At least this long. Up to 50 us it spins: a sleep costs as much again for the wake-up.
void wait_at_least(std::int64_t duration_ns) noexcept;

}  // namespace cutforce::hal::os
