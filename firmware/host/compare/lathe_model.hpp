// The physics of ForceMachine without its sensor and without chance, made to be rolled ahead many
// thousand times a second: the feed lag (S29), the cut (S30), (S31), and what it costs to be off
// the reference. An interrupted cut is its mean over the turn.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "firmware/host/compare/part.hpp"
#include "hal/host/simulation/force_machine.hpp"

namespace cutforce::firmware::host {

struct LatheState {
  std::uint64_t step = 0;
  double position_m = 0.0;
  double feed_m_s = 0.0;
  double force_n = 0.0;
};

// What a rollout is charged, in N s.
struct LatheCost {
  double reference_n;    // of the true force
  double ceiling_pct;    // at it nothing more can be done, and a shortfall costs nothing
  double shortfall;      // 1 N s too little against 1 N s too much
  double reward_n_s_m;   // for a metre of path
  double enough = 1e30;  // a rollout that has cost this much may stop
};

class LatheModel {
 public:
  // Of a machine that passes its check, without jitter of the scan and without depth_after_lag.
  explicit LatheModel(const hal::host::ForceMachineConfig& config);

  // What is taken for known ahead of now: nothing (everything stays as it is), or all of it.
  struct Outlook {
    std::optional<double> gain_n;     // static force at the nominal chip; nothing: as it will be
    std::optional<double> turns_1_s;  // of the spindle
  };

  // Up to the step `to` at one override. Returns the cost, and stops at the end of the path.
  double roll(LatheState& state, std::uint64_t to, double override_pct, const Outlook& outlook,
              const LatheCost& cost) const;

  // The step at which an override sent at step `sent` begins to act: scan and latency, (S27),
  // (S28).
  [[nodiscard]] std::uint64_t acts_at(std::uint64_t sent) const;

  [[nodiscard]] LatheState start() const;
  [[nodiscard]] double gain_n(double position_m, double time_s) const;
  [[nodiscard]] double turns_1_s(double time_s) const;
  // Share of the nominal gain at this feed: (h / h_0)^p.
  [[nodiscard]] double chip_power(double feed_m_s, double turns_1_s) const;
  // Override whose static force is `force_n` at this gain; 0 where there is none.
  [[nodiscard]] double override_for(double force_n, double gain_n, double turns_1_s) const;
  [[nodiscard]] bool at_end(const LatheState& state) const {
    return state.position_m >= config_.feed.length_m;
  }
  [[nodiscard]] double step_s() const { return config_.step_s; }
  [[nodiscard]] double feed_m_s(double turns_1_s) const;
  [[nodiscard]] double process_share() const { return process_share_; }
  [[nodiscard]] double sensor_share() const { return sensor_share_; }

 private:
  hal::host::ForceMachineConfig config_;
  double feed_share_;
  double process_share_;
  double sensor_share_;
  double first_scan_s_;
  std::uint64_t latency_steps_;
  std::vector<double> power_;  // of the relative chip, in equal cells
};

}  // namespace cutforce::firmware::host
