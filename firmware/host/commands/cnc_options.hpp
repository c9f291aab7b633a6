// The options of cutforce cnc, and what they are to the bench.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "firmware/host/bench/bench.hpp"

namespace cutforce::firmware::host {

struct CncOptions {
  std::string can;
  LineChoice lines{.chip = {},
                   .data = {},
                   .strobe = -1,
                   .alive = -1,
                   .alarm = -1,
                   .inhibit = -1,
                   .data_active_low = false,
                   .active_low = {}};
  double inhibit_at_s = 5.0;
  double inhibit_for_s = 1.0;
  std::string code = "binary";
  unsigned node = 1;
  std::string lathe;
  unsigned speed_every = kSpeedEvery;
  double duration_s = 0.0;
  double wait_s = 30.0;
  bool no_wait = false;
  double latency_ms = 10.0;
  double timeout_ms = 250.0;
  std::string on_silence = "hold";
  bool arm = false;
  bool control = false;
  bool rearm = false;
  double arm_at_s = 1.5;
  double control_at_s = 2.0;
  double reference_n = 0.0;
  double limit_ratio = 0.0;
  int floor_pct = -1;
  int ceiling_pct = -1;
  unsigned tool = 1;
  bool threading = false;
  std::string out;
  bool json = false;
  bool abrupt = false;

  void add_to(CLI::App& command);
  [[nodiscard]] Bench::Config bench() const;
};

}  // namespace cutforce::firmware::host
