#include "firmware/host/compare/comparison.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <mutex>
#include <thread>

namespace cutforce::firmware::host {
namespace {

constexpr std::uint64_t kStepsPerPoint = 10;  // of 2 ms

ComparisonCell cut(const Contender& contender, const Part& part, const ComparisonOptions& options) {
  ComparisonCell cell;
  for (std::uint32_t seed = 1; seed <= options.seeds; ++seed) {
    const Part made = in_surroundings(part, options.surroundings, seed);
    Watch watch{};
    if (options.traces && seed == 1) {
      watch = [&cell, gain = made.machine.sensor.gain_ratio,
               step = std::uint64_t{0}](const hal::host::ForceMachine& machine) mutable {
        if (step++ % kStepsPerPoint != 0) return;
        const auto truth = machine.truth();
        cell.trace.force_n.push_back(static_cast<float>(gain * truth.force_n));
        cell.trace.override_pct.push_back(static_cast<float>(truth.override_pct));
      };
    }
    cell.seeds.push_back(cut_part(contender, made, {}, watch));
  }
  cell.mean = mean(cell.seeds);
  return cell;
}

}  // namespace

void on_threads(std::size_t count, unsigned threads, const std::function<void(std::size_t)>& work,
                const WorkProgress& progress) {
  std::atomic<std::size_t> next = 0;
  std::atomic<std::size_t> done = 0;
  std::mutex mutex;
  std::exception_ptr failure;
  const auto labour = [&](const WorkProgress& tell) {
    try {
      for (std::size_t k = next++; k < count; k = next++) {
        work(k);
        ++done;
        if (tell) tell(done, count);
      }
      if (tell) tell(done, count);  // the others may have left it nothing to do
    } catch (...) {
      const std::scoped_lock lock(mutex);
      if (!failure) failure = std::current_exception();
      next = count;
    }
  };
  {
    std::vector<std::jthread> helpers;
    for (unsigned k = 1; k < threads && k < count; ++k) {
      helpers.emplace_back([&labour] { labour({}); });
    }
    labour(progress);
  }
  if (failure) std::rethrow_exception(failure);
}

PartMetrics mean(const std::vector<PartMetrics>& metrics) {
  PartMetrics mean = total(metrics);
  const double count = static_cast<double>(std::max<std::size_t>(1, metrics.size()));
  for (double PartMetrics::*sum :
       {&PartMetrics::impulse_ns, &PartMetrics::impulse_105_ns, &PartMetrics::shortfall_ns,
        &PartMetrics::above_110_s, &PartMetrics::time_s, &PartMetrics::changes}) {
    mean.*sum /= count;
  }
  mean.settling_s = 0.0;
  for (const PartMetrics& m : metrics) mean.settling_s += m.settling_s / count;
  return mean;
}

const ComparisonRow* Comparison::find(std::string_view contender) const {
  const auto found = std::ranges::find(
      rows, contender, [](const ComparisonRow& row) { return row.contender->name; });
  return found != rows.end() ? &*found : nullptr;
}

std::size_t Comparison::part_index(std::string_view part) const {
  return static_cast<std::size_t>(std::ranges::find(parts, part, &Part::name) - parts.begin());
}

Comparison compare(const ComparisonOptions& options, const WorkProgress& progress) {
  const auto begin = std::chrono::steady_clock::now();
  Comparison result{.surroundings = options.surroundings,
                    .seeds = options.seeds,
                    .robustness = options.robustness,
                    .parts = options.parts};
  const std::size_t parts = options.parts.size();
  for (const Contender* contender : options.contenders) {
    result.rows.push_back({.contender = contender,
                           .cells = std::vector<ComparisonCell>(parts),
                           .total = {},
                           .robustness = {}});
    result.cuts += parts * options.seeds;
  }
  const std::size_t columns = parts + (options.robustness ? 1 : 0);
  on_threads(
      result.rows.size() * columns, options.threads,
      [&](std::size_t k) {
        ComparisonRow& row = result.rows[k / columns];
        const std::size_t column = k % columns;
        if (column < parts) {
          row.cells[column] = cut(*row.contender, options.parts[column], options);
        } else if (!row.contender->oracle) {
          row.robustness = robustness_of(*row.contender, {});
        }
      },
      progress);
  for (ComparisonRow& row : result.rows) {
    std::vector<PartMetrics> means;
    for (const ComparisonCell& cell : row.cells) means.push_back(cell.mean);
    row.total = total(means);
  }
  result.elapsed_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace cutforce::firmware::host
