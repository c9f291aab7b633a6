#include "firmware/host/commands/progress.hpp"

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <utility>

namespace cutforce::firmware::host {
namespace {

std::atomic<int> stop_signal{0};
static_assert(std::atomic<int>::is_always_lock_free, "set by a signal handler");

void note(int signal) { stop_signal = signal; }

}  // namespace

void catch_stop_signals() {
  struct sigaction action {};
  action.sa_handler = note;
  sigemptyset(&action.sa_mask);
  // Once: who is in a hurry sends a second one.
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

Progress::Progress(std::string what, std::string unit, double total)
    : what_(std::move(what)),
      unit_(std::move(unit)),
      total_(total),
      began_(std::chrono::steady_clock::now()),
      shown_(began_),
      terminal_(isatty(STDERR_FILENO) != 0) {}

Progress::~Progress() {
  if (visible_) std::fputs("\r\033[K", stderr);
}

void Progress::show(double done) { show(done, {}); }

void Progress::show(double done, const std::string& what) {
  using namespace std::chrono_literals;
  if (const int signal = stop_signal; signal != 0) throw Stopped{signal};
  if (!terminal_) return;
  const auto now = std::chrono::steady_clock::now();
  if (now - began_ < 1s || now - shown_ < 200ms) return;
  shown_ = now;
  visible_ = true;
  const std::string text = what.empty() ? what_ : what_ + ", " + what;
  if (total_ > 0.0) {
    std::fprintf(stderr, "\r\033[K%s: %.0f of %.0f %s, %.0f %%", text.c_str(), done, total_,
                 unit_.c_str(), 100.0 * done / total_);
  } else {
    std::fprintf(stderr, "\r\033[K%s: %.0f %s", text.c_str(), done, unit_.c_str());
  }
  std::fflush(stderr);
}

}  // namespace cutforce::firmware::host
