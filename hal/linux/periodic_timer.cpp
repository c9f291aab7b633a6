#include "hal/linux/periodic_timer.hpp"

namespace cutforce::hal::os {
namespace {

constexpr std::int64_t kShortestNs = 1'000;
constexpr std::int64_t kLongestNs = 10'000'000'000;

}  // namespace

auto PeriodicTimer::start(std::int64_t period_ns) -> std::expected<PeriodicTimer, OpenError> {
  if (period_ns < kShortestNs || period_ns > kLongestNs) {
    return std::unexpected{OpenError{"periodic timer",
                                     "a period of " + std::to_string(period_ns) + " ns",
                                     "take one from 1 us to 10 s"}};
  }
  return PeriodicTimer{period_ns};
}

auto PeriodicTimer::wait() noexcept -> Wake {
  const auto tick = schedule_.next(monotonic_ns());
  sleep_until(tick.due_ns);
  return {.due_ns = tick.due_ns, .late_ns = monotonic_ns() - tick.due_ns, .missed = tick.missed};
}

}  // namespace cutforce::hal::os
