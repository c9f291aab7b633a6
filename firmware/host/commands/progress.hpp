// How far long work is, on a terminal only, and its interruption by a person. SIGINT and SIGTERM
// set a flag; update() throws Stopped, so that everything on the way out cleans up after itself and
// no partial file stays.
#pragma once

#include <chrono>
#include <string>

namespace cutforce::firmware::host {

struct Stopped {
  int signal;
};

// From now on SIGINT and SIGTERM end the work at its next update().
void catch_stop_signals();

class Progress {
 public:
  // Nothing is shown within the first second. `unit` is what is counted.
  Progress(std::string what, std::string unit, double total = 0.0);
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  ~Progress();  // clears the line

  // Cheap: looks at the clock once in a thousand calls. Throws Stopped.
  void update(double done) {
    if (++calls_ % 1024U == 0) show(done);
  }
  void show(double done);
  void show(double done, const std::string& what);

 private:
  std::string what_;
  std::string unit_;
  double total_;
  std::chrono::steady_clock::time_point began_;
  std::chrono::steady_clock::time_point shown_;
  unsigned calls_ = 0;
  bool terminal_;
  bool visible_ = false;
};

}  // namespace cutforce::firmware::host
