// From the override on the wire to the feed of the tool: the PLC reads it at its own scan, the CNC
// needs its time, the servo lags. Equations (S27)-(S29).
#pragma once

#include <cstdint>

#include "hal/host/simulation/delay_line.hpp"
#include "hal/host/simulation/random.hpp"

namespace cutforce::hal::host {

struct FeedConfig {
  double start_s = 0.0;               // time at which the program starts to feed
  double feed_m_rev = 0.0;            // at 100 %, per spindle turn; 0: use feed_m_s
  double feed_m_s = 0.0;              // at 100 %, per time
  double length_m = 0.0;              // end of the path
  double cutting_move_start_m = 0.0;  // from there on the CNC reports a cutting move
  double latency_s = 0.0;             // dead time after the scan
  double scan_s = 0.0;                // PLC scan; its phase is drawn from the seed; 0: no scan
  double scan_jitter_s = 0.0;         // every scan is late by up to this
  double lag_s = 0.0;                 // feed servo
  double initial_override_pct = 100.0;
};

class FeedServo {
 public:
  struct State {
    double position_m = 0.0;
    double feed_m_s = 0.0;
    double override_pct = 0.0;  // in effect: after scan and latency, as the CNC reports it
    bool feeding = false;
  };

  FeedServo(const FeedConfig& config, double period_s, std::uint64_t seed);

  void set_override(double percent) noexcept { wire_pct_ = percent; }
  void step(double time_s, double spindle_turns_s) noexcept;
  // Moving at the initial override already.
  void settle(double spindle_turns_s) noexcept;
  [[nodiscard]] const State& state() const noexcept { return state_; }

 private:
  [[nodiscard]] double programmed_m_s(double spindle_turns_s) const noexcept;

  FeedConfig config_;
  double period_s_;
  double lag_share_;
  RandomStream random_;
  DelayLine<double> latency_;
  double wire_pct_;
  double scanned_pct_;
  double scan_due_s_;
  double next_scan_s_;
  State state_;
};

}  // namespace cutforce::hal::host
