#include <algorithm>
#include <array>
#include <cmath>

#include "firmware/host/compare/goals.hpp"

namespace cutforce::firmware::host {
namespace {

constexpr std::uint64_t kHeldBack = 8;  // random parts that nobody tuned to
constexpr double kLong_s = 120.0;
constexpr double kSettled_s = 3.0;

// A long cut of one depth, from 3 s on.
struct LongFigures {
  double changes_1_s;
  double mean_error_ratio;
  double spread_ratio;
  double retreats_1_min;  // falls of the override by more than 15 % that nothing has called for
};

LongFigures long_figures(const Contender& subject) {
  Part part = in_surroundings(long_cut(1e-3), Surroundings::kNoise, 1);
  part.time_limit_s = kLong_s;
  double last_pct = -1.0;
  double sum_n = 0.0;
  double square = 0.0;
  double count = 0.0;
  double changes = 0.0;
  double retreats = 0.0;
  const Trial trial{};
  const double gain = part.machine.sensor.gain_ratio;
  [[maybe_unused]] const auto metrics =
      cut_part(subject, part, trial, [&](const hal::host::ForceMachine& machine) {
        if (machine.time_s() < kSettled_s) return;
        const auto truth = machine.truth();
        const double force_n = gain * truth.force_n;
        sum_n += force_n;
        square += force_n * force_n;
        count += 1.0;
        if (last_pct >= 0.0 && truth.override_pct != last_pct) changes += 1.0;
        if (truth.override_pct < 0.85 * last_pct) retreats += 1.0;
        last_pct = truth.override_pct;
      });
  const double watched_s = kLong_s - kSettled_s;
  const double mean_n = sum_n / count;
  const double reference_n = trial.limits.reference_n;
  return {.changes_1_s = changes / watched_s,
          .mean_error_ratio = std::abs(mean_n / reference_n - 1.0),
          .spread_ratio = std::sqrt(std::max(0.0, square / count - mean_n * mean_n)) / reference_n,
          .retreats_1_min = 60.0 * retreats / watched_s};
}

double impulse(const std::vector<PartMetrics>& metrics) {
  double sum_ns = 0.0;
  for (const PartMetrics& m : metrics) sum_ns += m.impulse_105_ns;
  return sum_ns;
}

// The force seen as its mean over a turn, as an interrupted cut wants it.
Part seen_by_the_turn() {
  std::vector<Part> parts = comparison_parts();
  Part keyway = *std::ranges::find(parts, "keyway", &Part::name);
  keyway = in_surroundings(std::move(keyway), Surroundings::kNoise, 1);
  keyway.machine.sensor.mean_s = 0.06;
  return keyway;
}

// Of a second pass: impulse over that of the first where the parts are clamped this much off.
double misaligned_ratio(const Contender& first, const Contender& second, double misalignment_m) {
  std::vector<PartMetrics> before;
  std::vector<PartMetrics> after;
  for (const Part& drawn : comparison_parts()) {
    const Part part = in_surroundings(drawn, Surroundings::kNoise, 1);
    Trial trial{};
    trial.misalignment_m = misalignment_m;
    before.push_back(cut_part(first, part, trial));
    after.push_back(cut_part(second, part, trial));
  }
  return impulse(after) / impulse(before);
}

void without_map(Machine& m) {
  m.controller = ControllerName::kPredictive;
  m.predictive_learns = false;
}

// What a map of another part does: each part after the one that stands before it in the list,
// beside the same without a map.
struct WrongMap {
  double peak_ratio;  // of the worst part
  double time_ratio;
};
WrongMap wrong_map(const Contender& second) {
  Contender plain = second;
  plain.choose = &without_map;
  std::vector<Part> parts;
  for (const Part& part : comparison_parts()) {
    parts.push_back(in_surroundings(part, Surroundings::kNoise, 1));
  }
  WrongMap worst{0.0, 0.0};
  double time_s = 0.0;
  double usual_s = 0.0;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    Trial trial{};
    trial.taught_by = &parts[(k + parts.size() - 1) % parts.size()];
    const PartMetrics usual = cut_part(plain, parts[k], trial);
    const PartMetrics misled = cut_part(second, parts[k], trial);
    worst.peak_ratio = std::max(worst.peak_ratio, misled.peak_ratio / usual.peak_ratio);
    time_s += misled.time_s;
    usual_s += usual.time_s;
  }
  worst.time_ratio = time_s / usual_s;
  return worst;
}

}  // namespace

std::vector<Goal> further_goals(const Contender& subject, unsigned threads,
                                const WorkProgress& progress) {
  const Contender& bound = *find_contender("oracle_detected");
  std::vector<PartMetrics> own(kHeldBack);
  std::vector<PartMetrics> best(kHeldBack);
  LongFigures steady{};
  PartMetrics turn{};
  PartMetrics turn_best{};
  Contender second = subject;
  second.pass = 2;
  std::array<double, 2> misaligned{};
  WrongMap misled{};
  const auto work = [&](std::size_t k) {
    if (k < 2 * kHeldBack) {
      const std::uint64_t seed = k / 2 + 1;
      const Part part = in_surroundings(random_part(seed), Surroundings::kNoise, seed);
      (k % 2 == 0 ? own : best)[k / 2] = cut_part(k % 2 == 0 ? subject : bound, part, {});
    } else if (k == 2 * kHeldBack) {
      steady = long_figures(subject);
    } else if (k == 2 * kHeldBack + 1) {
      misaligned[0] = misaligned_ratio(subject, second, 0.2e-3);
    } else if (k == 2 * kHeldBack + 2) {
      misaligned[1] = misaligned_ratio(subject, second, 0.4e-3);
    } else if (k == 2 * kHeldBack + 3) {
      misled = wrong_map(second);
    } else {
      turn = cut_part(subject, seen_by_the_turn(), {});
      turn_best = cut_part(bound, seen_by_the_turn(), {});
    }
  };
  on_threads(2 * kHeldBack + 5, threads, work, progress);
  std::vector<Goal> goals{
      {1, "I105 over the oracle, parts that nobody tuned to", impulse(own) / impulse(best), 1.25},
      {5, "pass 2, clamped 0.2 mm off: I105 over that of the first", misaligned[0], 0.05},
      {5, "pass 2, clamped 0.4 mm off: I105 over that of the first", misaligned[1], 0.20},
      {5, "map of another part: peak over that without", misled.peak_ratio, 1.15},
      {5, "map of another part: time over that without", misled.time_ratio, 1.10},
      {7, "changes a second in a steady cut, 2 % noise", steady.changes_1_s, 3.0},
      {7, "false retreats a minute, 2 % noise", steady.retreats_1_min, 0.1},
      {8, "steady mean error [%]", 100.0 * steady.mean_error_ratio, 0.5},
      {8, "spread of the steady force [%]", 100.0 * steady.spread_ratio, 1.6},
      {9, "interrupted cut seen by the turn: rms [%]", 100.0 * turn.rms_ratio, 7.0},
      {9, "interrupted cut seen by the turn: time over the oracle's",
       turn.time_s / turn_best.time_s, 1.03}};
  return goals;
}

}  // namespace cutforce::firmware::host
