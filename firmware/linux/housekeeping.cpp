#include "firmware/linux/housekeeping.hpp"

#include <utility>

#include "control/supervisor_text.hpp"

namespace cutforce::firmware::board {

Housekeeping::Housekeeping(Shared& shared, Ports& ports, TraceFolder& traces,
                           std::optional<hal::os::Watchdog> watchdog,
                           hal::os::ServiceNotifier notifier, Say say)
    : shared_(shared),
      ports_(ports),
      traces_(traces),
      watchdog_(std::move(watchdog)),
      notifier_(std::move(notifier)),
      say_(std::move(say)) {}

void Housekeeping::run(std::int64_t now_ns) {
  drain();
  feed();
  restart_bus(now_ns);
}

void Housekeeping::drain() {
  StateChange change{};
  while (shared_.changes.pop(change)) tell(change);
  LoopOutput row{};
  while (shared_.rows.pop(row)) traces_.take(row);
}

void Housekeeping::tell(const StateChange& change) {
  const auto& reason = control::kReasonTexts[static_cast<std::size_t>(change.reason)];
  std::string text(control::kStateTexts[static_cast<std::size_t>(change.state)].name);
  text += ", override " + std::to_string(change.override_pct) + " %";
  if (change.reason != control::Reason::kNone) {
    text += ". " + std::string(reason.sentence) + " " + std::string(reason.remedy);
  }
  say_(text);
  static_cast<void>(notifier_.status(text));  // nobody to tell it to
}

void Housekeeping::feed() {
  const Progress now{.ticks = shared_.ticks.load(std::memory_order_relaxed),
                     .bus = shared_.bus_passes.load(std::memory_order_relaxed),
                     .samples = shared_.sample_passes.load(std::memory_order_relaxed)};
  if (now.ticks == 0) return;  // the control thread is about to start
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
  if (watchdog_ && !watchdog_->feed() && !std::exchange(watchdog_refused_, true)) {
    say_("the watchdog does not take its food: the machine will be reset");
  }
  if (!ready_) ready_ = notifier_.ready().has_value();
  static_cast<void>(notifier_.alive());  // told again the next time
}

void Housekeeping::restart_bus(std::int64_t now_ns) {
  // Also where nobody answers: the frame that waits there would be the first to go out, and old.
  if (shared_.bus_failed.load(std::memory_order_relaxed)) delay_.failed(now_ns);
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
  static_cast<void>(notifier_.stopping());
  drain();
  traces_.close();
  if (watchdog_ && !watchdog_->stop()) say_("the watchdog cannot be stopped");
}

}  // namespace cutforce::firmware::board
