#include "firmware/linux/control_thread.hpp"

#include <algorithm>
#include <utility>

#include "firmware/board_cycle.hpp"
#include "hal/linux/allocation_count.hpp"
#include "hal/linux/monotonic_clock.hpp"
#include "hal/linux/periodic_timer.hpp"
#include "hal/linux/real_time.hpp"

namespace cutforce::firmware::board {
namespace {

using hal::os::GpioByte;
using hal::os::IioSource;
using hal::os::SocketCan;
using Cycle = BoardCycle<SocketCan, GpioByte, IioSource>;

// After the request to stop: the last frames go out, one a tick.
constexpr std::uint64_t kFarewellTicks = 20;

template <class T>
void store(std::atomic<T>& shared, T value) noexcept {
  shared.store(value, std::memory_order_relaxed);
}

struct ThreadCounts {
  std::uint64_t page_faults;
  std::uint64_t allocations;
};
ThreadCounts thread_counts() noexcept {
  const hal::os::PageFaults faults = hal::os::page_faults();
  return {.page_faults = faults.minor + faults.major, .allocations = hal::os::allocation_count()};
}

// What has happened since the board was armed for the first time.
class ArmedCount {
 public:
  explicit ArmedCount(Shared& shared) noexcept : shared_(shared) {}

  void tick(const BoardOutput& output, std::uint32_t missed) noexcept {
    using control::SupervisorState;
    const SupervisorState now_in = output.supervision.state;
    if (!armed_ && (now_in < SupervisorState::kMonitor || now_in > SupervisorState::kHold)) return;
    const ThreadCounts now = thread_counts();
    if (!armed_) {
      armed_ = true;
      before_ = now;
      return;
    }
    missed_ += missed;
    store(shared_.armed_ticks, ++ticks_);
    store(shared_.armed_missed, missed_);
    store(shared_.armed_page_faults, now.page_faults - before_.page_faults);
    store(shared_.armed_allocations, now.allocations - before_.allocations);
  }

 private:
  Shared& shared_;
  ThreadCounts before_{};
  std::uint64_t ticks_ = 0;
  std::uint64_t missed_ = 0;
  bool armed_ = false;
};

// Of the state, from tick to tick: within one the supervisor may take several steps, and its own
// `changed` is of the last.
class Changes {
 public:
  explicit Changes(Shared& shared) noexcept : shared_(shared) {}

  void note(std::int64_t now_ns, const control::Supervisor::Output& now) noexcept {
    if (now.state == state_ && now.reason == reason_) return;
    state_ = now.state;
    reason_ = now.reason;
    shared_.changes.push({.time_ns = now_ns,
                          .state = now.state,
                          .reason = now.reason,
                          .override_pct = now.override_pct});
  }

 private:
  Shared& shared_;
  control::SupervisorState state_ = control::SupervisorState::kBoot;
  control::Reason reason_ = control::Reason::kNone;
};

}  // namespace

ControlThread::ControlThread(Board& board, Ports& ports, Shared& shared, Settings settings)
    : board_(board), ports_(ports), shared_(shared), settings_(settings) {
  thread_ = std::thread([this] { run(); });
}

ControlThread::~ControlThread() { stop(); }

void ControlThread::stop() {
  shared_.stop.store(true);
  if (thread_.joinable()) thread_.join();
}

std::vector<std::string> ControlThread::warnings() const {
  return warned_.load(std::memory_order_acquire) ? warnings_ : std::vector<std::string>{};
}

// Each refusal is a sentence for a person, and no reason not to run.
std::optional<hal::os::WakeupLatency> ControlThread::prepare() {
  const auto note = [this](const auto& result) {
    if (!result) warnings_.push_back(result.error().text());
  };
  note(hal::os::lock_memory());
  hal::os::prefault_stack();
  note(hal::os::run_in_real_time(settings_.priority));
  auto latency = hal::os::WakeupLatency::limit(0);
  note(latency);
  return latency ? std::optional{std::move(*latency)} : std::nullopt;
}

void ControlThread::run() {
  const auto latency = prepare();
  warned_.store(true, std::memory_order_release);

  Cycle cycle(board_, {.can = &ports_.can,
                       .bytes = ports_.bytes ? &*ports_.bytes : nullptr,
                       .source = ports_.source ? &*ports_.source : nullptr});
  auto timer = hal::os::PeriodicTimer::start(settings_.tick_ns).value();
  ArmedCount armed(shared_);
  Changes changes(shared_);
  const auto keep = [this](const LoopOutput& row) { shared_.rows.push(row); };
  BoardHealth health{};
  health.self_test_done = health.self_test_passed = health.ports_open = true;
  std::uint64_t missed = 0;
  std::uint64_t farewell = 0;
  for (std::uint64_t tick = 1; farewell < kFarewellTicks; ++tick) {
    health.missed_ticks = timer.wait().missed;
    missed += health.missed_ticks;
    health.stop = shared_.stop.load(std::memory_order_relaxed) ||
                  (settings_.ticks != 0 && tick > settings_.ticks);
    const std::int64_t began_ns = hal::os::monotonic_ns();
    const BoardOutput output = cycle.run(began_ns, health, keep);
    changes.note(began_ns, output.supervision);
    armed.tick(output, health.missed_ticks);
    const auto took_us = static_cast<std::uint32_t>((hal::os::monotonic_ns() - began_ns) / 1000);
    health.worst_loop_us = std::max(health.worst_loop_us, took_us);
    store(shared_.worst_loop_us, health.worst_loop_us);
    store(shared_.missed_ticks, missed);
    store(shared_.bus_failed, Board::is_down(cycle.bus()));
    store(shared_.bus_passes, cycle.bus_passes());
    store(shared_.sample_passes, cycle.sample_passes());
    store(shared_.ticks, tick);
    if (health.stop) ++farewell;
  }
  shared_.finished.store(true);
}

}  // namespace cutforce::firmware::board
