#include "hal/linux/monotonic_clock.hpp"

#include <time.h>

#include <cerrno>

namespace cutforce::hal::os {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int64_t kLongestSpinNs = 50'000;

}  // namespace

std::int64_t monotonic_ns() noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * kSecondNs + now.tv_nsec;
}

void sleep_until(std::int64_t time_ns) noexcept {
  const timespec until{.tv_sec = time_ns / kSecondNs, .tv_nsec = time_ns % kSecondNs};
  while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

void wait_at_least(std::int64_t duration_ns) noexcept {
  if (duration_ns <= 0) return;
  const auto until = monotonic_ns() + duration_ns;
  if (duration_ns > kLongestSpinNs) return sleep_until(until);
  while (monotonic_ns() < until) {
  }
}

}  // namespace cutforce::hal::os
