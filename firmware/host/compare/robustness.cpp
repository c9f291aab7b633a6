#include "firmware/host/compare/robustness.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <functional>

namespace cutforce::firmware::host {
namespace {

using hal::host::Profile;

constexpr double kJump_s = 2.0;
constexpr double kEnd_s = 20.0;
constexpr double kWatched_s = 6.0;
constexpr float kFloorPct = 5.0F;
constexpr std::array<double, 11> kRatios{1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0};

}  // namespace

Swing swing_of(const std::vector<double>& force_n, double reference_n) {
  if (force_n.empty()) return {};
  double mean_n = 0.0;
  for (const double n : force_n) mean_n += n / static_cast<double>(force_n.size());
  Swing swing;
  double square = 0.0;
  for (std::size_t k = 0; k < force_n.size(); ++k) {
    square += (force_n[k] - mean_n) * (force_n[k] - mean_n);
    if (k > 0 && (force_n[k] > mean_n) != (force_n[k - 1] > mean_n)) ++swing.crossings;
  }
  swing.spread_ratio = std::sqrt(square / static_cast<double>(force_n.size())) / reference_n;
  return swing;
}

Swing swing_in(const Contender& contender, const LongCut& cut, const Trial& trial) {
  Trial own = trial;
  own.floor_pct = kFloorPct;
  Part part = long_cut(cut.gain_before * 1e-3);
  part.time_limit_s = kEnd_s;
  part.machine.process.wear_ratio =
      Profile{{kJump_s, 1.0}, {kJump_s, cut.gain_after / cut.gain_before}};
  part.machine.feed.latency_s = cut.latency_s;
  std::vector<double> force_n;
  [[maybe_unused]] const auto metrics =
      cut_part(contender, part, own, [&force_n](const hal::host::ForceMachine& machine) {
        if (machine.time_s() > kEnd_s - kWatched_s) force_n.push_back(machine.truth().force_n);
      });
  return swing_of(force_n, trial.limits.reference_n);
}

Robustness robustness_of(const Contender& contender, const Trial& trial) {
  Robustness result;
  for (const double ratio : kRatios) {
    if (swing_in(contender, {.gain_after = ratio}, trial).sustained()) break;
    result.gain_up_ratio = ratio;
  }
  for (const double ratio : kRatios) {
    if (swing_in(contender, {.gain_before = ratio}, trial).sustained()) break;
    result.gain_down_ratio = ratio;
  }
  for (int k = 0; k <= 12; ++k) {
    const double latency_s = 0.05 * k;
    const LongCut cut{.gain_after = 1.5, .latency_s = latency_s};
    if (swing_in(contender, cut, trial).sustained()) break;
    result.latency_s = latency_s;
  }
  return result;
}

}  // namespace cutforce::firmware::host
