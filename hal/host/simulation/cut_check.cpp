#include <cstddef>

#include "hal/host/simulation/config_checker.hpp"
#include "hal/host/simulation/cutting_process.hpp"
#include "hal/host/simulation/feed_servo.hpp"

namespace cutforce::hal::host {
namespace {

constexpr double kMost = 1e9;

}  // namespace

void check_cut(ConfigChecker& c, const ProcessConfig& p, const FeedConfig& f) {
  c.within(p.specific_force_n_m2, "process.specific_force_n_m2", 0.0, 1e12);
  c.positive(p.nominal_feed_m_rev, "process.nominal_feed_m_rev", 1.0);
  c.within(p.exponent, "process.exponent", 0.1, 2.0);
  c.within(p.lag_s, "process.lag_s", 0.0, 100.0);
  c.profile(p.depth_m, "process.depth_m", 0.0, 0.1);
  c.profile(p.diameter_m, "process.diameter_m", 1e-4, 100.0);
  c.profile(p.wear_ratio, "process.wear_ratio", 0.0, 100.0);
  for (const HardSpot& spot : p.hard_spots) {
    c.require(spot.end_m > spot.begin_m, "process.hard_spots", "ends before it begins",
              "give end_m above begin_m");
    c.within(spot.factor, "process.hard_spots", 0.0, 100.0);
  }
  c.within(p.slots_per_turn, "process.slots_per_turn", 0.0, 1000.0);
  c.within(p.slot_ratio, "process.slot_ratio", 0.0, 1.0);
  c.within(f.start_s, "feed.start_s", 0.0, kMost);
  c.within(f.feed_m_rev, "feed.feed_m_rev", 0.0, 1.0);
  c.within(f.feed_m_s, "feed.feed_m_s", 0.0, 10.0);
  c.require(!(f.feed_m_rev > 0.0 && f.feed_m_s > 0.0), "feed.feed_m_s",
            "and feed.feed_m_rev are both given", "give the feed per turn or the feed per time");
  c.within(f.length_m, "feed.length_m", 0.0, 1e4);
  c.within(f.cutting_move_start_m, "feed.cutting_move_start_m", 0.0, 1e4);
  c.within(f.latency_s, "feed.latency_s", 0.0, 10.0);
  c.within(f.scan_s, "feed.scan_s", 0.0, 10.0);
  c.within(f.scan_jitter_s, "feed.scan_jitter_s", 0.0, f.scan_s);
  c.within(f.lag_s, "feed.lag_s", 0.0, 10.0);
  c.within(f.initial_override_pct, "feed.initial_override_pct", 0.0, 254.0);
}

}  // namespace cutforce::hal::host
