#include "firmware/host/bench/bench_run.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "firmware/host/bench/bench_trace.hpp"
#include "firmware/host/commands/progress.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::InputError;
using Clock = std::chrono::steady_clock;

// Samples that are late are sent one after the other, up to so much; then the plant has stood
// still.
constexpr std::chrono::milliseconds kMostBehind{100};
constexpr std::size_t kMostFramesAStep = 256;
constexpr std::int64_t kStepsAShow = 50;
// MachineStates after the end; a board that has just started trusts the third.
constexpr std::int64_t kClosing_ns = 5 * Bench::kMachineStateCycle_ns;

// An absolute schedule, and how badly it was kept.
class Pace {
 public:
  explicit Pace(std::int64_t period_ns) : period_(period_ns), due_(Clock::now()) {}

  void wait() {
    due_ += period_;
    std::this_thread::sleep_until(due_);
    const auto behind = Clock::now() - due_;
    if (behind > period_) ++late_;
    worst_ = std::max(worst_, behind);
    if (behind > kMostBehind) due_ += behind;
  }

  void add_to(std::vector<Figure>& figures) const {
    figures.push_back({"late", "Samples sent late", static_cast<double>(late_), "",
                       "by more than a sample period"});
    figures.push_back({"latest_ms", "Latest of them",
                       std::chrono::duration<double, std::milli>(worst_).count(), "ms"});
  }

 private:
  std::chrono::nanoseconds period_;
  Clock::time_point due_;
  Clock::duration worst_{};
  std::uint64_t late_ = 0;
};

class Session {
 public:
  Session(Bench& bench, CanLink* can, LineLink* lines) : bench_(bench), can_(can), lines_(lines) {}

  std::expected<void, InputError> receive() {
    std::array<hal::can::Frame, 32> frames;
    for (std::size_t taken = 0; can_ != nullptr && taken < kMostFramesAStep;) {
      const auto count = can_->receive(frames);
      if (!count) return refused("CAN interface");
      for (std::size_t k = 0; k < *count; ++k) bench_.receive(frames[k]);
      if (*count < frames.size()) break;
      taken += *count;
    }
    std::array<LineEvent, 64> events;
    if (lines_ == nullptr) return {};
    const auto count = lines_->read(events);
    if (!count) return refused("GPIO lines");
    for (std::size_t k = 0; k < *count; ++k) bench_.receive(events[k]);
    return {};
  }

  void step() {
    std::array<hal::can::Frame, Bench::kMostFrames> frames;
    const std::size_t count = bench_.step(frames);
    for (std::size_t k = 0; can_ != nullptr && k < count; ++k) {
      if (!can_->send(frames[k])) ++unsent_;
    }
  }

  std::expected<void, InputError> show_inhibit() {
    if (lines_ == nullptr || bench_.inhibits() == inhibits_) return {};
    inhibits_ = bench_.inhibits();
    if (!lines_->set_inhibit(inhibits_)) return refused("inhibit line");
    return {};
  }

  // The board is given back. What it answers does not matter any more, nor does a link that fails.
  void leave(Pace* pace) {
    bench_.leave();
    for (std::int64_t left_ns = kClosing_ns; left_ns > 0; left_ns -= bench_.period_ns()) {
      if (pace != nullptr) pace->wait();
      if (!receive()) return;
      step();
    }
  }

  [[nodiscard]] double unsent() const { return static_cast<double>(unsent_); }

 private:
  static std::unexpected<InputError> refused(const char* where) {
    return std::unexpected{InputError{where, "the system refuses to read it any more",
                                      "see dmesg; bring it up again and start anew"}};
  }

  Bench& bench_;
  CanLink* can_;
  LineLink* lines_;
  std::uint64_t unsent_ = 0;
  bool inhibits_ = false;
};

std::int64_t whole_ns(double time_s) { return static_cast<std::int64_t>(time_s * 1e9 + 0.5); }

}  // namespace

std::expected<BenchResult, InputError> run_bench(Bench& bench, CanLink* can, LineLink* lines,
                                                 const BenchRun& run) {
  std::optional<BenchTrace> trace;
  if (!run.trace.empty()) {
    auto created = BenchTrace::create(run.trace);
    if (!created) return std::unexpected{created.error()};
    trace = std::move(*created);
  }
  Session session(bench, can, lines);
  BenchLog log;
  Progress progress("cnc", "s", run.duration_s);
  Pace pace(bench.period_ns());
  const std::int64_t most_waiting = whole_ns(run.wait_s) / bench.period_ns();
  try {
    for (std::int64_t k = 0, waited = 0; waited <= most_waiting; ++k) {
      if (run.duration_s > 0.0 && bench.now_ns() > whole_ns(run.duration_s)) break;
      if (run.paced) pace.wait();
      if (auto received = session.receive(); !received) return std::unexpected{received.error()};
      session.step();
      if (auto shown = session.show_inhibit(); !shown) return std::unexpected{shown.error()};
      log.note(bench);
      if (bench.row().waiting) ++waited;
      if (trace) {
        if (auto taken = trace->take(bench); !taken) return std::unexpected{taken.error()};
      }
      if (k % kStepsAShow == 0) {
        progress.show(static_cast<double>(bench.now_ns()) * 1e-9, live_text(bench));
      }
    }
  } catch (const Stopped&) {
    // A bench without end is ended by a person; what it has seen is what it is for.
  }
  if (trace) {
    if (auto finished = trace->finish(); !finished) return std::unexpected{finished.error()};
  }
  BenchResult result{.figures = log.figures(bench),
                     .events = log.events(),
                     .verdict = log.verdict(bench),
                     .held = log.held(bench)};
  if (can != nullptr) {
    result.figures.push_back({"unsent", "Frames that could not be sent", session.unsent()});
  }
  if (run.paced) pace.add_to(result.figures);
  if (!run.abrupt && !bench.row().waiting) session.leave(run.paced ? &pace : nullptr);
  return result;
}

}  // namespace cutforce::firmware::host
