#include "firmware/host/design/latency_bank.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace cutforce::firmware::host {
namespace {

constexpr double kMoves = 0.04;
constexpr std::size_t kFewestTicks = 10;

// Every row that ends a tick.
std::vector<std::size_t> ticks_of(const StepTest& test, double period_s) {
  std::vector<std::size_t> rows{0};
  for (std::size_t k = 1; k < test.time_s.size(); ++k) {
    if (test.time_s[k] - test.time_s[rows.back()] > 0.999 * period_s) rows.push_back(k);
  }
  return rows;
}

double lowest_of_parabola(const LatencyOpinion& bank, std::size_t best, double spacing_s) {
  if (best == 0 || best + 1 == kCandidateCount) return bank.latency_s[best];
  const double left = bank.cost[best - 1];
  const double right = bank.cost[best + 1];
  const double bend = left - 2.0 * bank.cost[best] + right;
  return bank.latency_s[best] + (bend > 0.0 ? 0.5 * spacing_s * (left - right) / bend : 0.0);
}

}  // namespace

std::optional<LatencyOpinion> latency_bank(const StepTest& test, const IdentifiedPlant& plant,
                                           double period_s, double spacing_s) {
  LatencyOpinion bank{};
  std::array<std::vector<double>, kCandidateCount> answer;
  for (std::size_t i = 0; i < kCandidateCount; ++i) {
    bank.latency_s[i] = static_cast<double>(i) * spacing_s;
    answer[i] = override_response(
        test.changes,
        {.dead_time_s = bank.latency_s[i],
         .lag_s = {plant.lag_s.value, plant.known_lags_s[0], plant.known_lags_s[1]},
         .exponent = plant.exponent.value,
         .reference_pct = plant.override_pct},
        test.time_s);
  }
  const auto rows = ticks_of(test, period_s);
  const double floor_n = 0.05 * plant.force_n;  // below it the tool is not cutting
  for (std::size_t n = 1; n < rows.size(); ++n) {
    const auto now = rows[n];
    const auto before = rows[n - 1];
    if (!(test.force_n[now] > floor_n && test.force_n[before] > floor_n)) continue;
    const double moved = std::log(test.force_n[now] / test.force_n[before]);
    std::array<double, kCandidateCount> expected{};
    for (std::size_t i = 0; i < kCandidateCount; ++i)
      expected[i] = std::log(answer[i][now] / answer[i][before]);
    if (std::ranges::none_of(expected, [](double x) { return std::abs(x) > kMoves; })) continue;
    ++bank.ticks;
    for (std::size_t i = 0; i < kCandidateCount; ++i)
      bank.cost[i] += (moved - expected[i]) * (moved - expected[i]);
  }
  const auto best =
      static_cast<std::size_t>(std::ranges::min_element(bank.cost) - bank.cost.begin());
  const double least = bank.cost[best];
  if (bank.ticks < kFewestTicks || !(least > 0.0)) return {};
  for (double& cost : bank.cost) cost /= least;
  bank.best_s = lowest_of_parabola(bank, best, spacing_s);
  return bank;
}

}  // namespace cutforce::firmware::host
