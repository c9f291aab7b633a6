#include "firmware/host/compare/goals.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace cutforce::firmware::host {
namespace {

// Parts that begin with a change of twice or more.
constexpr std::array<std::string_view, 4> kLargeSteps{"step4", "entry3", "ksjump2", "satur"};
// Parts whose features are longer than the way on which the feed can be changed.
constexpr std::array<std::string_view, 8> kMapped{"step1.5", "step4", "entry", "entry3",
                                                  "exit_re", "slots", "ramp",  "stairs"};

class GoalList {
 public:
  GoalList(const Comparison& comparison, const ComparisonRow& subject)
      : comparison_(comparison), subject_(subject) {}

  void add(Goal goal) { goals_.push_back(std::move(goal)); }
  // The subject's figure over another contender's, where that takes part.
  void ratio(int number, const std::string& text, std::string_view other,
             double PartMetrics::*figure, double limit) {
    const ComparisonRow* row = comparison_.find(other);
    if (row == nullptr || !(row->total.*figure > 0.0)) return;
    add({number, text, subject_.total.*figure / (row->total.*figure), limit});
  }
  void settling(int number, const std::string& text, std::string_view part, double limit_s) {
    const std::size_t k = comparison_.part_index(part);
    if (k >= subject_.cells.size()) return;
    add({number, text, subject_.cells[k].mean.settling_s, limit_s});
  }
  // Part by part against the bound, except where next to nothing is left to gain.
  void parts(const ComparisonRow& bound) {
    for (std::size_t k = 0; k < subject_.cells.size(); ++k) {
      const std::string& name = comparison_.parts[k].name;
      const double own_ns = subject_.cells[k].mean.impulse_105_ns;
      const double bound_ns = bound.cells[k].mean.impulse_105_ns;
      const bool step = std::ranges::find(kLargeSteps, name) != kLargeSteps.end();
      const double limit = step ? 1.3 : name == "sine" ? 1.7 : 1.5;
      if (own_ns <= kLittle_ns || !(bound_ns > 0.0)) {
        add({2, name + ": I105 at most 15 N s", own_ns, kLittle_ns});
      } else {
        add({2, name + ": I105 over the oracle that sees 30 N", own_ns / bound_ns, limit});
      }
    }
  }
  [[nodiscard]] std::vector<Goal> take() { return std::move(goals_); }

 private:
  static constexpr double kLittle_ns = 15.0;
  const Comparison& comparison_;
  const ComparisonRow& subject_;
  std::vector<Goal> goals_;
};

void add_later_pass(GoalList& list, const Comparison& comparison, const ComparisonRow& first,
                    const ComparisonRow& later) {
  const std::string pass = "pass " + std::to_string(later.contender->pass);
  list.add({5, pass + ": I105 over that of the first",
            later.total.impulse_105_ns / first.total.impulse_105_ns, 0.05});
  list.add(
      {5, pass + ": time over that of the first", later.total.time_s / first.total.time_s, 1.08});
  double mapped = 0.0;
  double others = 0.0;
  for (std::size_t k = 0; k < later.cells.size(); ++k) {
    const bool known = std::ranges::find(kMapped, comparison.parts[k].name) != kMapped.end();
    double& peak = known ? mapped : others;
    peak = std::max(peak, later.cells[k].mean.peak_ratio);
  }
  list.add({5, pass + ": peak at steps, entries, slots, stairs, ramps", mapped, 1.10});
  list.add({5, pass + ": peak at features shorter than the way to react", others, 1.25});
}

}  // namespace

double constant_feed_time_s(const std::vector<Part>& parts, const Trial& trial) {
  double time_s = 0.0;
  for (const Part& part : parts) {
    const LatheModel model(part.machine);
    double gain_n = 0.0;
    constexpr int kPlaces = 400;
    for (int x = 0; x < kPlaces; ++x) {
      for (int t = 0; t < 30; ++t) {
        gain_n = std::max(gain_n, model.gain_n(part.machine.feed.length_m * x / kPlaces, 0.5 * t));
      }
    }
    const double turns = model.turns_1_s(0.0);
    const double safe_pct =
        std::clamp(model.override_for(trial.limits.reference_n, gain_n, turns),
                   static_cast<double>(trial.floor_pct), trial.limits.ceiling_pct);
    time_s += part.machine.feed.length_m / (0.01 * safe_pct * model.feed_m_s(turns));
  }
  return time_s;
}

std::vector<Goal> goals_of(const Comparison& comparison, std::string_view subject) {
  const ComparisonRow* own = comparison.find(subject);
  if (own == nullptr) return {};
  GoalList list(comparison, *own);
  constexpr auto kI105 = &PartMetrics::impulse_105_ns;
  const bool drawn = comparison.surroundings == Surroundings::kRandom;
  list.ratio(drawn ? 6 : 1, "I105 over the oracle that sees 30 N", "oracle_detected", kI105,
             drawn ? 2.2 : 1.35);
  if (const auto* bound = comparison.find("oracle_detected"); bound != nullptr && !drawn) {
    list.parts(*bound);
  }
  list.ratio(3, "I105 over the best-tuned PI", "pi_tuned", kI105, 1.0 / 2.5);
  list.ratio(3, "I105 over the best-tuned variable gain", "variable_gain_tuned", kI105, 1.0 / 3.0);
  list.ratio(3, "I105 over the cautious PI", "pi_cautious", kI105, 1.0 / 3.0);
  list.ratio(3, "I105 over LinuxCNC's PID on the drive's load", "linuxcnc_pid", kI105, 1.0 / 7.0);
  list.ratio(3, "time above 110 % over the cautious PI", "pi_cautious", &PartMetrics::above_110_s,
             0.4);
  list.settling(4, "5 % settling after 1 -> 1.5 mm [s]", "step1.5", 0.30);
  list.settling(4, "5 % settling after 1 -> 4 mm [s]", "step4", 0.40);
  for (const ComparisonRow& row : comparison.rows) {
    const bool later = row.contender->pass > 1 && row.contender->choose == own->contender->choose;
    if (later) add_later_pass(list, comparison, *own, row);
  }
  if (comparison.robustness) {
    list.add({6, "stable after a jump of the gain, up", own->robustness.gain_up_ratio, 8.0, false});
    list.add(
        {6, "stable after a jump of the gain, down", own->robustness.gain_down_ratio, 8.0, false});
    if (const auto* timing = comparison.find("predictive_timing"); timing != nullptr) {
      list.add({6, "stable up to a true latency of [s], dead time found while cutting",
                timing->robustness.latency_s, 0.40, false});
    }
  }
  list.add({11, "time over that of a constant safe feed",
            own->total.time_s / constant_feed_time_s(comparison.parts, {}), 0.70});
  return list.take();
}

}  // namespace cutforce::firmware::host
