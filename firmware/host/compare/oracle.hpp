// What could be reached at best: searches that know the machine exactly, down to the phase of the
// PLC's scan, and differ only in what they know of the cut.
//
//   present    the gain as it is at each tick, without noise or delay, but nothing of what comes:
//              a bound for any feedback
//   detected   as present, but a change is known only once the sensor is off by 30 N (three times
//              its noise) from what the believed machine would show: what feedback can hope for.
//              Not a strict bound: it is blind below 30 N, and a good estimator is not
//   preview    depth over the path, material over time, spindle speed, all in advance: a bound for
//              any map
//
// All know the spindle's speed of now. Receding horizon of 8 ticks: candidates round the best known
// sequence, from coarse to fine, rolled out on LatheModel. The searches are good, not proven
// optimal; host_tests compare them with what the dead time alone makes unavoidable.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "firmware/host/compare/lathe_model.hpp"
#include "firmware/host/compare/part.hpp"
#include "firmware/host/compare/part_run.hpp"
#include "hal/host/simulation/random.hpp"

namespace cutforce::firmware::host {

enum class Foresight : std::uint8_t { kPresent, kDetected, kPreview };

class Oracle {
 public:
  struct Config {
    Foresight foresight = Foresight::kPresent;
    PartLimits limits{};
    double floor_pct = 20.0;
    double detection_n = 30.0;
    std::uint32_t candidates = 48;
    std::uint32_t refinements = 3;
  };

  Oracle(const Part& part, const Config& config);

  // Once a control tick, from the first on: what to send, in whole per cent.
  [[nodiscard]] double decide();
  // The machine at the coming tick, as the oracle tracks it.
  [[nodiscard]] const LatheState& truth() const { return truth_; }

 private:
  static constexpr std::size_t kTicks = 8;
  using Sequence = std::array<double, kTicks>;

  struct Sent {
    std::uint64_t acts_at;
    double override_pct;
  };
  struct Search;

  void advance();
  void advance_step(double override_pct);
  void believe();
  [[nodiscard]] double in_effect(std::uint64_t step) const;
  [[nodiscard]] Search begin_search() const;
  [[nodiscard]] double cost_of(const Search& search, const Sequence& sequence, double enough) const;
  void consider(Search& search, const Sequence& sequence);
  void consider_families(Search& search);
  void consider_levels(Search& search, double first_pct, double then_pct);
  [[nodiscard]] double holding(const Search& search, double ahead_m) const;
  [[nodiscard]] Sequence changed(const Sequence& sequence, double reach);
  [[nodiscard]] double allowed(double override_pct) const;

  Config config_;
  LatheModel model_;
  LatheCost cost_;
  std::uint64_t steps_per_tick_;
  double sensor_gain_;
  double initial_override_pct_;
  hal::host::RandomStream random_;
  std::vector<Sent> sent_;  // in the order of their effect; the first one acts
  std::uint64_t tick_step_ = 0;
  LatheState truth_;
  double sensor_n_;
  double believed_gain_n_;
  double believed_force_n_;
  double believed_sensor_n_;
  Sequence best_{};
};

// For run_part. The oracle must outlive it.
[[nodiscard]] inline Decide decide_with(Oracle& oracle) {
  return [&oracle](const hal::Sample&, const hal::host::ForceMachine&) { return oracle.decide(); };
}

}  // namespace cutforce::firmware::host
