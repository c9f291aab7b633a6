#include "firmware/linux/housekeeping.hpp"

#include <utility>

#include "control/supervisor_text.hpp"

namespace cutforce::firmware::board {

Housekeeping::Housekeeping(Shared& shared, Ports& ports, TraceFolder& traces,
                           std::optional<hal::os::Watchdog> watchdog, Say say)
    : shared_(shared),
      ports_(ports),
      traces_(traces),
      watchdog_(std::move(watchdog)),
      say_(std::move(say)) {}

void Housekeeping::run(std::int64_t now_ns) {
  drain();
  feed(now_ns);
  restart_bus(now_ns);
}

void Housekeeping::drain() {
  StateChange change{};
  while (shared_.changes.pop(change)) tell(change);
  LoopOutput row{};
  while (shared_.rows.pop(row)) traces_.take(row);
}

void Housekeeping::tell(const StateChange& change) {
  std::string text(control::name_of(change.state));
  text += ", override " + std::to_string(change.override_pct) + " %";
  if (change.reason != control::Reason::kNone) {
    text += ": " + std::string(control::name_of(change.reason)) + "; " +
            std::string(control::remedy(change.reason));
  }
  say_(text);
  notifier_.status(text);
}

void Housekeeping::feed(std::int64_t) {
  const Progress now{.ticks = shared_.ticks.load(std::memory_order_relaxed),
                     .bus = shared_.bus_passes.load(std::memory_order_relaxed),
                     .samples = shared_.sample_passes.load(std::memory_order_relaxed)};
  const bool moved = now.ticks != fed_.ticks && now.bus != fed_.bus && now.samples != fed_.samples;
  if (!moved) {
    if (!starving_) {
      say_("the watchdogs are not fed: no progress of " +
           std::string(now.ticks == fed_.ticks ? "the control thread"
                       : now.bus == fed_.bus   ? "the bus"
                                               : "the sampling"));
    }
    starving_ = true;
    return;
  }
  starving_ = false;
  fed_ = now;
  if (watchdog_) watchdog_->feed();
  if (!std::exchange(ready_, true)) notifier_.ready();
  notifier_.feed();
}

void Housekeeping::restart_bus(std::int64_t now_ns) {
  const hal::BusState state = shared_.bus.load(std::memory_order_relaxed);
  if (state == hal::BusState::kOff || state == hal::BusState::kDown) delay_.failed(now_ns);
  if (!delay_.due(now_ns)) return;
  const auto restarted = ports_.can.restart();
  delay_.restarted(now_ns);
  if (restarted) {
    shared_.restarts.fetch_add(1, std::memory_order_relaxed);
    say_("the bus was restarted");
  } else if (!complained_) {
    say_(restarted.error().text());
  }
  complained_ = !restarted;
}

void Housekeeping::finish() {
  notifier_.stopping();
  drain();
  traces_.close();
  if (watchdog_) watchdog_->close();
}

}  // namespace cutforce::firmware::board
